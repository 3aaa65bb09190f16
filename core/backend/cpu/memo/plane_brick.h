// The voxels that a plane n.k + f (see plane.h) crosses.
#pragma once

#include <cstdint>

namespace voxdag::cpu {

// The plane crosses voxel k iff n.k lies within [least, most].
struct PlaneRange {
  int64_t least, most;

  PlaneRange(const int64_t (&n)[3], int64_t f, bool fractional) {
    int64_t rising = 0, size = 0;
    for (const int64_t x : n) {
      rising += x > 0 ? x : 0;
      size += x > 0 ? x : -x;
    }
    // Over a voxel's corners the value rises to n.k + f + rising, and falls below that by `size`.
    least = -(f + rising);
    most = least + size - (fractional ? 1 : 0);
  }
};

inline uint64_t plane_brick(const int64_t (&n)[3], int64_t f, bool fractional) {
  const PlaneRange crossed(n, f, fractional);
  uint64_t mask = 0;
  for (int voxel = 0; voxel < 64; ++voxel) {
    int64_t value = 0;
    for (int a = 0; a < 3; ++a) value += n[a] * ((voxel >> a & 1) | (voxel >> (a + 3) & 1) << 1);
    mask |= uint64_t{value >= crossed.least && value <= crossed.most} << voxel;
  }
  return mask;
}

}  // namespace voxdag::cpu
