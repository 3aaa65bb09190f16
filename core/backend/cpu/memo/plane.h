// The plane of a triangle, as seen by cubes that the triangle covers: nothing but the plane's
// direction and its offset from the cube's corner decides which voxels of such a cube are set.
#pragma once

#include <cstdint>
#include <optional>

#include "core/backend/cpu/triangle_set.h"
#include "core/base/integers.h"

namespace voxdag::cpu {

// n.p + c = 0 for lattice positions p, n without a common divisor. For a cube whose low corner is q
// let f = floor((n.q + c) / 256): with voxels k counted from there, the plane is at or above a
// voxel corner iff n.k + f >= 0 (256 i + c >= 0 <=> i + floor(c / 256) >= 0 for integers i), so
// that f alone, and whether the division left a remainder, say all.
struct Plane {
  int64_t n[3];
  int128 c;
  bool fractional;  // (n.q + c) / 256 is no integer, for all cubes alike: q is a multiple of 256

  // Sums of the positive and of the negative components.
  int64_t rising() const;
  int64_t falling() const;

  // True if all values n.k + f within a cube that the plane crosses fit 62 bits.
  bool fits(int size_log2) const;
  // Whether the plane touches a cube of 2^size_log2 voxels with offset f. Needs fits().
  bool crosses(int64_t f, int size_log2) const;
  // Sets f for a cube; false if the plane misses it. Needs fits().
  bool offset_from(const Box& cube, int size_log2, int64_t& f) const;
};

// Whether all vertices have the same coordinate along an axis, which makes a plane of the simplest
// kind, found without arithmetic.
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

// Of any triangle that is not degenerate.
Plane plane_of(const NarrowTriangle& t);

}  // namespace voxdag::cpu
