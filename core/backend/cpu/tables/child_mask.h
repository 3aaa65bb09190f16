#pragma once

#include <cstdint>

namespace voxdag::cpu {

// How many children a mask names. A table, since a plain x86-64 counts bits by calling a library.
struct ChildCounts {
  uint8_t of[256] = {};
  constexpr ChildCounts() {
    for (int mask = 1; mask < 256; ++mask) of[mask] = static_cast<uint8_t>(of[mask / 2] + mask % 2);
  }
};
inline constexpr ChildCounts kChildCounts;

inline int child_count_of(uint32_t mask) { return kChildCounts.of[mask & 0xff]; }

}  // namespace voxdag::cpu
