// The stored color of what the surfaces in a cell add up to.
#pragma once

#include <algorithm>

#include "core/color/color_sum.h"

namespace voxdag {

inline Color color_of(const ColorSum& sum) {
  const bool seen = sum.seen_weight != 0;
  const uint64_t weight = std::max<uint64_t>(seen ? sum.seen_weight : sum.weight, 1);
  Color color;
  for (size_t c = 0; c < 3; ++c)
    color.rgb[c] = static_cast<uint8_t>((seen ? sum.seen[c] : sum.plain[c]) / weight >> 8);
  color.alpha = static_cast<uint8_t>(seen ? 255 : 0);
  return color;
}

}  // namespace voxdag
