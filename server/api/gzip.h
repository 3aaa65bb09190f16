// The content coding gzip (RFC 9110, 8.4.1.3). Stateless; thread-safe.
#pragma once

#include <string>
#include <string_view>

namespace voxdag::server {

// Whether the value of Accept-Encoding allows it.
bool accepts_gzip(std::string_view accepted);
// Throws Error{kOutOfMemory}.
std::string gzip(std::string_view bytes);

}  // namespace voxdag::server
