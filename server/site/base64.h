#pragma once

#include <string>
#include <string_view>

namespace voxdag::server {

// Returns the bytes in base64, with padding.
std::string base64_of(std::string_view bytes);

}  // namespace voxdag::server
