// The linear light of sRGB values that are integers from 0 to 255 or from 0 to 65535.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "scene/textures/linear_light.h"

namespace voxdag::points {

class LightTable {
 public:
  explicit LightTable(uint16_t max) : light_(size_t{max} + 1) {
    for (size_t i = 0; i < light_.size(); ++i)
      light_[i] = linear_light(static_cast<double>(i) / max);
  }
  // Returns the light of `value`. A value above the maximum counts as the maximum.
  uint16_t of(uint16_t value) const { return light_[std::min<size_t>(value, light_.size() - 1)]; }

 private:
  std::vector<uint16_t> light_;
};

}  // namespace voxdag::points
