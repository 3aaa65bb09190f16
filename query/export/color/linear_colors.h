// The linear light of stored colors, for formats that require it. The numbers are the same on every
// machine.
#pragma once

#include <array>
#include <cstdint>

#include "scene/textures/linear_light.h"

namespace voxdag::query {

// Element i is the linear value of the sRGB byte i; 65535 is 1.
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
