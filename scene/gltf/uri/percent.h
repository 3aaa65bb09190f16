// Percent-encoding (RFC 3986), also in the invalid form that some programs write.
#pragma once

#include <string>
#include <string_view>

namespace voxdag::gltf {

// Decodes %XX. A percent sign without two hexadecimal digits means itself.
std::string percent_decoded_leniently(std::string_view text);

}  // namespace voxdag::gltf
