#include "scene/gltf/uri/percent.h"

#include "core/base/text.h"

namespace voxdag::gltf {

std::string percent_decoded_leniently(std::string_view text) {
  std::string decoded;
  decoded.reserve(text.size());
  for (size_t i = 0; i < text.size(); ++i) {
    const auto escaped = text[i] == '%' ? percent_decoded(text.substr(i, 3)) : std::nullopt;
    decoded += escaped ? escaped->front() : text[i];
    if (escaped) i += 2;
  }
  return decoded;
}

}  // namespace voxdag::gltf
