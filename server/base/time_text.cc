#include "server/base/time_text.h"

#include <cmath>
#include <cstdio>

#include "core/base/text.h"

namespace voxdag::server {

std::string time_text(double unix_s) {
  if (unix_s == 0) return "";
  const auto milliseconds = static_cast<int64_t>(std::floor(unix_s * 1000));
  char fraction[8];
  std::snprintf(fraction, sizeof fraction, ".%03dZ", static_cast<int>(milliseconds % 1000));
  return utc_text(milliseconds / 1000, "%Y-%m-%dT%H:%M:%S") + fraction;
}

}  // namespace voxdag::server
