// The target of a request, "/api/v1/jobs?limit=5", taken apart.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace voxdag::server {

struct Target {
  std::string path;                          // as sent, without the query
  std::vector<std::string> segments;         // percent-decoded; "/" has none
  std::map<std::string, std::string> query;  // percent-decoded
};

// Throws Problem (400) for broken escapes, control characters, a repeated query name or a target
// that is no path. Dots are not resolved: "." and ".." are names like others, and nothing bears
// them.
Target parse_target(std::string_view text);

}  // namespace voxdag::server
