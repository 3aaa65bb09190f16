// The parsed target of a request, such as "/api/v1/jobs?limit=5".
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace voxdag::server {

struct Target {
  std::string path;                          // as sent, without the query
  std::vector<std::string> segments;         // percent-decoded; empty for "/"
  std::map<std::string, std::string> query;  // percent-decoded
};

// Parses a target. Throws Problem (400) for malformed escapes, control characters, a repeated query
// parameter, or a target that is not a path. Does not resolve "." and "..": they are ordinary names
// that no route has.
Target parse_target(std::string_view text);

}  // namespace voxdag::server
