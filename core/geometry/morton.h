// Morton codes: the bits of x, y and z interleaved. In each group of three bits, x is the highest.
// The order of sorted codes is the order of a walk over the octree in child order (child index =
// 4x + 2y + z).
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag {

// Moves bit i of a 21-bit number to bit 3i.
VOXDAG_HD inline uint64_t spread_bits3(uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x001f00000000ffffull;
  x = (x | x << 16) & 0x001f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  x = (x | x << 2) & 0x1249249249249249ull;
  return x;
}

// The inverse of spread_bits3(): moves bit 3i to bit i. Ignores all other bits.
VOXDAG_HD inline uint32_t gather_bits3(uint64_t x) {
  x &= 0x1249249249249249ull;
  x = (x | x >> 2) & 0x10c30c30c30c30c3ull;
  x = (x | x >> 4) & 0x100f00f00f00f00full;
  x = (x | x >> 8) & 0x001f0000ff0000ffull;
  x = (x | x >> 16) & 0x001f00000000ffffull;
  x = (x | x >> 32) & 0x1fffff;
  return static_cast<uint32_t>(x);
}

VOXDAG_HD inline uint64_t morton_encode(uint32_t x, uint32_t y, uint32_t z) {
  return spread_bits3(x) << 2 | spread_bits3(y) << 1 | spread_bits3(z);
}

VOXDAG_HD inline void morton_decode(uint64_t code, uint32_t& x, uint32_t& y, uint32_t& z) {
  x = gather_bits3(code >> 2);
  y = gather_bits3(code >> 1);
  z = gather_bits3(code);
}

}  // namespace voxdag
