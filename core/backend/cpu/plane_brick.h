#pragma once

#include <cstdint>

namespace voxdag::cpu {

// The voxels of a brick that a plane n.k + f (see plane.h) crosses.
inline uint64_t plane_brick(const int64_t (&n)[3], int64_t f, bool fractional) {
  int64_t rising = 0, size = 0;
  for (const int64_t x : n) {
    rising += x > 0 ? x : 0;
    size += x > 0 ? x : -x;
  }
  // Over a voxel's corners the value rises to n.k + f + rising, and falls below that by `size`.
  const uint64_t width = static_cast<uint64_t>(size - (fractional ? 1 : 0));
  uint64_t mask = 0;
  for (int voxel = 0; voxel < 64; ++voxel) {
    int64_t value = f + rising;
    for (int a = 0; a < 3; ++a) value += n[a] * ((voxel >> a & 1) | (voxel >> (a + 3) & 1) << 1);
    // Below 0 is far above any width.
    mask |= uint64_t{static_cast<uint64_t>(value) <= width} << voxel;
  }
  return mask;
}

}  // namespace voxdag::cpu
