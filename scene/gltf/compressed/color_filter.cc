#include "scene/gltf/compressed/color_filter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

namespace voxdag::gltf {
namespace {

template <class T>
void decode(std::span<std::byte> elements) {
  using Signed = std::make_signed_t<T>;
  constexpr float kMax = std::numeric_limits<T>::max();
  for (; !elements.empty(); elements = elements.subspan(4 * sizeof(T))) {
    T in[4], out[4];
    std::memcpy(in, elements.data(), sizeof in);
    const int y = in[0], co = static_cast<Signed>(in[1]), cg = static_cast<Signed>(in[2]);
    // The highest set bit of in[3] is not part of alpha. The position of this bit gives the number
    // of bits per component.
    const int largest = (1 << std::bit_width(in[3])) - 1;
    const int alpha = in[3] & largest >> 1;
    const int rgba[4] = {y + co - cg, y + cg, y - co - cg, alpha << 1 | (alpha & 1)};
    const float scale = largest == 0 ? 0 : kMax / static_cast<float>(largest);
    for (int c = 0; c < 4; ++c)
      out[c] =
          static_cast<T>(std::clamp(std::round(static_cast<float>(rgba[c]) * scale), 0.0f, kMax));
    std::memcpy(elements.data(), out, sizeof out);
  }
}

}  // namespace

void decode_color_filter(std::span<std::byte> elements, size_t stride) {
  stride == 4 ? decode<uint8_t>(elements) : decode<uint16_t>(elements);
}

}  // namespace voxdag::gltf
