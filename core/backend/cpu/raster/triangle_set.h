// The triangles of one subvolume in compact form, and the cubes that they are tested against.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/dag/consing/pooled_memory.h"
#include "core/geometry/cube.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag::cpu {

// A triangle in lattice coordinates, v[axis][vertex]. Axis 0 is x. Bit 2 - a of a child index
// belongs to axis a (child_coordinate()). Bits 2 - a and 5 - a of a voxel's bit number in its brick
// also belong to axis a (brick_coordinate()).
template <class Int>
struct Triangle {
  Int v[3][3];

  Int low(int axis) const { return std::min({v[axis][0], v[axis][1], v[axis][2]}); }
  Int high(int axis) const { return std::max({v[axis][0], v[axis][1], v[axis][2]}); }
};

// A narrow triangle has |coordinates| < 2^30 and an extent of at most 2^28 (2^20 voxels) along
// every axis, like every triangle inside the largest grid. All other triangles are wide, with
// |coordinates| < 2^40.
using NarrowTriangle = Triangle<int32_t>;
using WideTriangle = Triangle<int64_t>;

inline constexpr int64_t kNarrowCoordinate = int64_t{1} << 30;
inline constexpr int64_t kNarrowExtent = int64_t{1} << 28;

// Lattice coordinates of a cube.
struct LatticeCube {
  int64_t low[3];
  int64_t edge;

  template <class Int>
  bool misses(const Triangle<Int>& t) const {
    for (int a = 0; a < 3; ++a)
      if (t.high(a) < low[a] || t.low(a) > low[a] + edge) return true;
    return false;
  }
  LatticeCube child(int index) const {
    const int64_t half = edge / 2;
    return {{low[0] + (index >> 2) * half, low[1] + (index >> 1 & 1) * half,
             low[2] + (index & 1) * half},
            half};
  }
};

inline LatticeCube lattice_cube(const Cube& cube, uint32_t grid_levels) {
  LatticeCube out;
  out.edge = cube.edge_voxels(grid_levels) * kUnitsPerVoxel;
  for (int a = 0; a < 3; ++a) out.low[a] = cube.position[a] * out.edge;
  return out;
}

// The inverse of axis_major().
template <class Int>
FixedTriangle vertex_major(const Triangle<Int>& t) {
  FixedTriangle out;
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i) out.v[i][a] = t.v[a][i];
  return out;
}

inline WideTriangle axis_major(const FixedTriangle& t) {
  WideTriangle out;
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i) out.v[a][i] = t.v[i][a];
  return out;
}

inline bool is_narrow(const WideTriangle& t) {
  for (int a = 0; a < 3; ++a) {
    const int64_t low = t.low(a), high = t.high(a);
    if (high - low > kNarrowExtent || low <= -kNarrowCoordinate || high >= kNarrowCoordinate)
      return false;
  }
  return true;
}

inline NarrowTriangle narrowed(const WideTriangle& t) {
  NarrowTriangle out;
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i) out.v[a][i] = static_cast<int32_t>(t.v[a][i]);
  return out;
}

// A triangle during the descent of the octree: its number, and two flags.
//
// A triangle *covers* a cube if, in the projection along the axis of the largest component of the
// triangle's normal, the cube is inside the triangle. Then the triangle touches a voxel of the cube
// iff the triangle's plane touches the voxel, so no edge tests are necessary.
struct Entry {
  static constexpr uint32_t kInside = 1u << 31;  // the triangle covers the current cube
  static constexpr uint32_t kWide = 1u << 30;    // number() is the number of a wide triangle
  uint32_t bits;

  bool inside() const { return bits & kInside; }
  bool wide() const { return bits & kWide; }
  uint32_t number() const { return bits & (kWide - 1); }
};

// True if all vertices of `other` are in the plane of `t`. `t` must not be degenerate.
bool is_in_plane(const NarrowTriangle& other, const NarrowTriangle& t);

// The triangles of one subvolume. Not thread-safe. Throws OutOfBudget.
class TriangleSet {
 public:
  explicit TriangleSet(PooledMemory& memory) : memory_(memory) {}

  // Narrow triangles have the numbers 0..narrow_count()-1. Wide triangles have the numbers
  // 0..wide_count()-1, and kWide is set in their entries.
  uint32_t narrow_count() const { return narrow_count_; }
  uint32_t wide_count() const { return wide_count_; }
  void add(const WideTriangle& triangle);
  // Frees the memory.
  void clear();
  const NarrowTriangle& narrow(Entry entry) const { return narrow_[entry.number()]; }
  const WideTriangle& wide(Entry entry) const { return wide_[entry.number()]; }

 private:
  PooledMemory& memory_;
  // narrow_ has one unused element at its end, because the AVX2 kernels load four coordinates at a
  // time, even where only the last three remain.
  PooledArray<NarrowTriangle> narrow_;
  PooledArray<WideTriangle> wide_;
  uint32_t narrow_count_ = 0;
  uint32_t wide_count_ = 0;
};

}  // namespace voxdag::cpu
