// The voxels of a brick that a plane n.k + f (plane.h) crosses.
#pragma once

#include <cstdint>

#include "core/dag/brick.h"

namespace voxdag::cpu {

// The plane crosses voxel k iff low <= n.k <= high.
struct PlaneRange {
  int64_t low, high;

  PlaneRange(const int64_t (&n)[3], int64_t f, bool fractional) {
    int64_t rising = 0, size = 0;
    for (const int64_t x : n) {
      rising += x > 0 ? x : 0;
      size += x > 0 ? x : -x;
    }
    // Over a voxel's corners the value rises to n.k + f + rising, and falls below that by `size`.
    low = -(f + rising);
    high = low + size - (fractional ? 1 : 0);
  }
};

inline uint64_t plane_brick(const int64_t (&n)[3], int64_t f, bool fractional) {
  const PlaneRange crossed(n, f, fractional);
  uint64_t mask = 0;
  for (int voxel = 0; voxel < 64; ++voxel) {
    int64_t value = 0;
    for (int a = 0; a < 3; ++a) value += n[a] * brick_coordinate(voxel, a);
    mask |= uint64_t{value >= crossed.low && value <= crossed.high} << voxel;
  }
  return mask;
}

}  // namespace voxdag::cpu
