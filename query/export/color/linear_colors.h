// Converts stored colors to linear light, for formats that require it. The results are the same on
// every machine.
#pragma once

#include <array>
#include <cstdint>

#include "scene/textures/linear_light.h"

namespace voxdag::query {

// Returns a table. Element i is the linear light of the sRGB byte i; 65535 means full intensity.
inline const std::array<uint16_t, 256>& linear_of_srgb() {
  static const std::array<uint16_t, 256> table = [] {
    std::array<uint16_t, 256> linear{};
    for (size_t i = 0; i < linear.size(); ++i)
      linear[i] = linear_light(static_cast<double>(i) / 255);
    return linear;
  }();
  return table;
}

}  // namespace voxdag::query
