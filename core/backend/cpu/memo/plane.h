// The plane of a triangle. If the triangle covers a cube, the set voxels of the cube depend only on
// the plane's direction and on its offset from the cube's corner.
#pragma once

#include <cstdint>
#include <optional>

#include "core/backend/cpu/raster/triangle_set.h"
#include "core/base/integers.h"
#include "core/dag/brick.h"

namespace voxdag::cpu {

// n.p + c = 0 for lattice positions p, n without a common divisor. For a cube whose low corner is q
// let f = floor((n.q + c) / 256): with voxels k counted from there, the plane is at or above a
// voxel corner iff n.k + f >= 0 (256 i + c >= 0 <=> i + floor(c / 256) >= 0 for integers i), so
// the voxels depend only on f and on whether the division left a remainder.
struct Plane {
  int64_t n[3];
  int128 c;
  // (n.q + c) / 256 is not an integer; the same for all cubes, because q is a multiple of 256.
  bool fractional;

  // rising() returns the sum of the positive components of n, falling() the sum of the negative
  // components.
  int64_t rising() const;
  int64_t falling() const;

  // True if all values n.k + f within a cube that the plane crosses fit in 62 bits.
  bool fits(int size_log2) const;
  // True if the plane touches a cube of 2^size_log2 voxels with offset f. Requires fits().
  bool crosses(int64_t f, int size_log2) const;
  // Sets f for a cube. Returns false if the plane misses the cube. Requires fits().
  bool offset_from(const LatticeCube& cube, int size_log2, int64_t& f) const;
};

// Returns the plane of a triangle whose vertices have equal coordinates along an axis. Needs no
// arithmetic.
template <class Int>
std::optional<Plane> axis_aligned_plane(const Triangle<Int>& t) {
  for (int a = 0; a < 3; ++a) {
    if (t.v[a][0] != t.v[a][1] || t.v[a][1] != t.v[a][2]) continue;
    Plane plane{{0, 0, 0}, -static_cast<int128>(t.v[a][0]), true};
    plane.n[a] = 1;
    return plane;
  }
  return {};
}

// Returns the plane of a triangle, which must not be degenerate.
Plane plane_of(const NarrowTriangle& t);

// Range of n.k: the plane n.k + f crosses voxel k iff low <= n.k <= high.
struct PlaneRange {
  int64_t low, high;

  PlaneRange(const int64_t (&n)[3], int64_t f, bool fractional) {
    int64_t rising = 0, size = 0;
    for (const int64_t x : n) {
      rising += x > 0 ? x : 0;
      size += x > 0 ? x : -x;
    }
    // Over a voxel's corners the value rises to n.k + f + rising. Its minimum is `size` below that
    // maximum.
    low = -(f + rising);
    high = low + size - (fractional ? 1 : 0);
  }
};

// Returns the voxels of a brick that the plane n.k + f crosses.
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
