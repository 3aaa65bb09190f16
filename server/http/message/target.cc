#include "server/http/message/target.h"

#include <algorithm>

#include "core/base/text.h"
#include "scene/messages.h"
#include "server/http/message/problem.h"

namespace voxdag::server {
namespace {

std::string decode(std::string text, bool plus_is_space) {
  if (plus_is_space) std::ranges::replace(text, '+', ' ');
  auto out = percent_decoded(text);
  if (!out)
    throw bad_request("the request target has a malformed percent escape in '" + printable(text) +
                      "': expected % and two hex digits");
  for (const char c : *out)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
      throw bad_request("the request target has a control character in '" + printable(text) +
                        "': expected none");
  return std::move(*out);
}

// Calls use(part) for each part between separators.
template <class Use>
void split(std::string_view text, char separator, const Use& use) {
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(separator, begin), text.size());
    use(text.substr(begin, end - begin));
    begin = end + 1;
  }
}

void parse_query(std::string_view text, std::map<std::string, std::string>& query) {
  split(text, '&', [&](std::string_view pair) {
    if (pair.empty()) return;
    const size_t equals = std::min(pair.find('='), pair.size());
    const std::string_view value =
        equals < pair.size() ? pair.substr(equals + 1) : std::string_view{};
    const auto [at, is_new] = query.emplace(decode(std::string(pair.substr(0, equals)), true),
                                            decode(std::string(value), true));
    if (!is_new)
      throw bad_request("the query parameter '" + printable(at->first) +
                        "' is repeated: expected it once");
  });
}

// Returns a target without scheme and host: "/path" for "http://host/path".
std::string_view without_origin(std::string_view text) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (!text.starts_with(scheme)) continue;
    const size_t slash = text.find('/', scheme.size());
    return slash == std::string_view::npos ? "/" : text.substr(slash);
  }
  return text;
}

}  // namespace

Target parse_target(std::string_view text) {
  text = without_origin(text.substr(0, text.find('#')));
  if (!text.starts_with('/'))
    throw bad_request("the request target '" + printable(text) + "' is not a path: expected /...");
  Target target;
  const size_t mark = std::min(text.find('?'), text.size());
  target.path = text.substr(0, mark);
  if (target.path.size() > 1)
    split(text.substr(1, mark - 1), '/', [&](std::string_view part) {
      target.segments.push_back(decode(std::string(part), false));
    });
  if (mark < text.size()) parse_query(text.substr(mark + 1), target.query);
  return target;
}

}  // namespace voxdag::server
