// Header fields of a request or an answer. Names compare case-insensitively (ASCII).
#pragma once

#include <map>
#include <string>
#include <string_view>

namespace voxdag::server {

struct HeaderLess {
  using is_transparent = void;
  bool operator()(std::string_view a, std::string_view b) const;
};
using HeaderMap = std::multimap<std::string, std::string, HeaderLess>;

// Returns the value of the first field with this name, or "".
std::string header_value(const HeaderMap& headers, std::string_view name);
// Returns `text` without leading and trailing spaces and tabs.
std::string_view trimmed(std::string_view text);
bool equal_ignoring_case(std::string_view a, std::string_view b);
// True if `list`, the value of If-None-Match, contains the entity tag `tag` or is "*". The
// comparison is weak: it ignores the prefix W/.
bool has_tag(std::string_view list, std::string_view tag);

}  // namespace voxdag::server
