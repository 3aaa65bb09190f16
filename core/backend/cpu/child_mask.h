// The number of children in a child mask.
#pragma once

#include <cstdint>

namespace voxdag::cpu {

// popcount() of a child mask. A table, since the x86-64 baseline has no instruction for it.
struct ChildCounts {
  uint8_t of[256] = {};
  constexpr ChildCounts() {
    for (int mask = 1; mask < 256; ++mask) of[mask] = static_cast<uint8_t>(of[mask / 2] + mask % 2);
  }
};
inline constexpr ChildCounts kChildCounts;

inline int child_count_of(uint32_t mask) { return kChildCounts.of[mask & 0xff]; }

}  // namespace voxdag::cpu
