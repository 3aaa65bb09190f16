// The plane of a triangle. If the triangle covers a cube (see Entry in triangle_set.h), the set
// voxels of the cube depend only on the plane's direction and on its offset from the cube's corner.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "core/backend/cpu/raster/triangle_set.h"
#include "core/base/integers.h"
#include "core/dag/brick.h"
#include "core/geometry/voxel_rule.h"

namespace voxdag::cpu {

// The plane n.p + c = 0. Positions p have lattice coordinates, in units of 1/256 voxel
// (core/geometry/fixed_triangle.h). The components of n have no common divisor.
//
// For a cube with low corner q, the offset of the plane is f = floor((n.q + c) / 256). Let k be the
// position of a voxel corner in the cube, in voxels, so that its lattice position is q + 256 k. The
// value of n.p + c at this corner is >= 0 iff n.k + f >= 0, because for an integer i and any x, 256
// i + x >= 0 <=> i + floor(x / 256) >= 0. So the set voxels of the cube depend only on n, on f and
// on `fractional`. The voxel with low corner k is set iff
//     0 <= n.k + f + up <= width.
//
// With the rule kThin, this means that the row through the voxel's center along the dominant axis
// crosses the plane within the voxel (thin_triangle.h). For this rule, set_rule() changes c so that
// the formula above gives the value on this row instead of the value at the voxel's corner. It also
// subtracts 1 from c if points on the plane count as below it.
struct Plane {
  int64_t n[3];
  int128 c;
  // True if (n.q + c) / 256 is not an integer, where q is the low corner of a cube. This is the
  // same for all cubes, because q is a multiple of 256. With the rule kThin, it is always true.
  bool fractional;
  int64_t up, width;

  // Sets fractional, up and width from n and c. For the rule kThin, also adapts c.
  void set_rule(VoxelRule rule);

  // rising() returns the sum of the positive components of n, falling() the sum of the negative
  // components.
  int64_t rising() const;
  int64_t falling() const;

  // In the next four functions, the cube has an edge of 2^size_log2 voxels. The comment on this
  // struct explains n, k, f, p and c.
  //
  // True if, for every cube that the plane crosses, n.k + f fits in 62 bits at all corners k.
  bool fits(int size_log2) const;
  // True if a plane with this normal and with the offset f from a cube sets voxels of the cube.
  // Requires fits().
  bool crosses(int64_t f, int size_log2) const;
  // True if the plane is below a cube that it does not cross: n.p + c is positive in the cube. `f`
  // is as for crosses().
  bool is_below(int64_t f, int size_log2) const;
  // Sets `f` to the plane's offset from the cube. Returns false if the plane sets no voxel of the
  // cube; `f` is then unchanged. Requires fits().
  bool offset_from(const LatticeCube& cube, int size_log2, int64_t& f) const;
};

// Returns the plane of a triangle whose vertices have equal coordinates along an axis, and nullopt
// for all other triangles. Unlike plane_of(), it also accepts degenerate triangles and wide
// triangles (triangle_set.h).
template <class Int>
std::optional<Plane> axis_aligned_plane(const Triangle<Int>& t, VoxelRule rule) {
  for (int a = 0; a < 3; ++a) {
    if (t.v[a][0] != t.v[a][1] || t.v[a][1] != t.v[a][2]) continue;
    Plane plane{{0, 0, 0}, -static_cast<int128>(t.v[a][0]), true, 0, 0};
    plane.n[a] = 1;
    plane.set_rule(rule);
    return plane;
  }
  return {};
}

// Returns the sign of the component `axis` of the triangle's normal: 1, 0 or -1.
template <class Int>
int normal_sign(const Triangle<Int>& t, int axis) {
  const int b = (axis + 1) % 3, c = (axis + 2) % 3;
  const auto edge = [&](int a, int i) { return static_cast<int128>(t.v[a][i + 1]) - t.v[a][i]; };
  const int128 x = edge(b, 0) * edge(c, 1) - edge(c, 0) * edge(b, 1);
  return x > 0 ? 1 : x < 0 ? -1 : 0;
}

// Returns the plane of a triangle, which must not be degenerate.
Plane plane_of(const NarrowTriangle& t, VoxelRule rule);

// The sides of a plane that are inside a solid. `below` is the side with n.p + c < 0 (Plane).
struct InnerSides {
  bool below = false, above = false;

  bool any() const { return below || above; }
  uint32_t bits() const { return (below ? 1u : 0u) | (above ? 2u : 0u); }
  bool operator==(const InnerSides&) const = default;
};

// The range of n.k for the voxels that a plane with offset f sets in a cube: low <= n.k <= high.
// Here n and f are as for Plane, and k is the position of a voxel's low corner in the cube, in
// voxels.
struct PlaneRange {
  int64_t low, high;

  PlaneRange(int64_t least, int64_t most) : low(least), high(most) {}
  PlaneRange(int64_t up, int64_t width, int64_t f) : low(-(f + up)), high(low + width) {}
  // Returns this range, extended to all voxels of the inner sides.
  PlaneRange with(InnerSides inner) const {
    return {inner.below ? std::numeric_limits<int64_t>::min() : low,
            inner.above ? std::numeric_limits<int64_t>::max() : high};
  }
};

// Returns a brick's mask. It has the voxels that a plane sets if the plane's offset from the brick
// is f, and all voxels of the inner sides.
inline uint64_t plane_brick(const Plane& plane, int64_t f, InnerSides inner = {}) {
  const PlaneRange crossed = PlaneRange(plane.up, plane.width, f).with(inner);
  uint64_t mask = 0;
  for (int voxel = 0; voxel < 64; ++voxel) {
    int64_t value = 0;
    for (int a = 0; a < 3; ++a) value += plane.n[a] * brick_coordinate(voxel, a);
    mask |= uint64_t{value >= crossed.low && value <= crossed.high} << voxel;
  }
  return mask;
}

}  // namespace voxdag::cpu
