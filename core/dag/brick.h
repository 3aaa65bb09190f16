// A brick: 4x4x4 voxels as one 64-bit mask. Bricks are the last level of the octree. Voxel (x, y,
// z) of a brick is this bit of the mask:
//
//   bit = 32 x1 + 16 y1 + 8 z1 + 4 x0 + 2 y0 + z0      (x1, x0: high and low bit of x, and so on)
//
// This number is the voxel's Morton code within the brick. So byte k of the mask has the voxels of
// octant k.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag {

inline constexpr int kBrickLevels = 2;  // log2(kBrickEdge); bricks are cubes of level L - 2
inline constexpr int kBrickEdge = 4;    // voxels

VOXDAG_HD inline int brick_bit(int x, int y, int z) {
  return (x & 2) << 4 | (y & 2) << 3 | (z & 2) << 2 | (x & 1) << 2 | (y & 1) << 1 | (z & 1);
}

// Returns the coordinate, 0 to 3, of a bit's voxel along an axis (0: x, 1: y, 2: z). This is the
// inverse of brick_bit().
VOXDAG_HD constexpr int brick_coordinate(int bit, int axis) {
  return (bit >> (2 - axis) & 1) | (bit >> (5 - axis) & 1) << 1;
}

// Returns a bit for each octant (2x2x2 voxels) of a brick: bit i is set if octant i has voxels,
// which means that byte i of `mask` is not 0.
VOXDAG_HD constexpr uint32_t octants(uint64_t mask) {
  constexpr uint64_t kLowBits = 0x7f7f7f7f7f7f7f7full;
  // In `tops`, the top bit of each byte is set if this byte of `mask` is not 0. The product
  // collects these eight bits in one byte.
  const uint64_t tops = (((mask & kLowBits) + kLowBits) | mask) & ~kLowBits;
  return static_cast<uint32_t>((tops >> 7) * 0x0102040810204080ull >> 56);
}

}  // namespace voxdag
