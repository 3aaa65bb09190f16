// Descends the octree with a triangle: finds the children of a cube that the triangle touches. The
// test is exact for a closed triangle and closed cubes, so every way of walking the tree finds the
// same cubes.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/geometry/cube.h"
#include "core/geometry/fixed_triangle.h"
#include "core/geometry/overlap.h"

namespace voxdag {

// Returns the cube of `level`, at most cube.level, that contains `cube`.
inline Cube ancestor(const Cube& cube, uint32_t level) {
  const uint32_t up = cube.level - level;
  return {level, {cube.position[0] >> up, cube.position[1] >> up, cube.position[2] >> up}};
}

// True if `inner` is `outer` or inside it.
inline bool contains(const Cube& outer, const Cube& inner) {
  return inner.level >= outer.level && ancestor(inner, outer.level) == outer;
}

// Tests whether a triangle is inside a cube. Consecutive triangles of a scene are usually in the
// same cube, so callers test the last triangle's cube before they descend the octree.
class CubeInside {
 public:
  // Creates an empty cube, which contains no triangle.
  CubeInside() = default;
  CubeInside(const Cube& cube, uint32_t grid_levels)
      : shift_(kUnitBits + static_cast<int>(grid_levels - cube.level)) {
    for (int a = 0; a < 3; ++a) low_[a] = static_cast<int64_t>(cube.position[a]) << shift_;
  }
  bool contains(const FixedTriangle& triangle) const {
    uint64_t distances = 0;  // bitwise or of all distances from the low corner
    for (const auto& vertex : triangle.v)
      for (int a = 0; a < 3; ++a) distances |= static_cast<uint64_t>(vertex[a] - low_[a]);
    return distances >> shift_ == 0;
  }

 private:
  int64_t low_[3] = {};
  int shift_ = 0;
};

// The range of cells, on one level of the octree, that a triangle's bounding box touches.
struct CellBox {
  CellBox(const FixedTriangle& triangle, uint32_t grid_levels, uint32_t cell_level)
      : level(cell_level) {
    const int shift = kUnitBits + static_cast<int>(grid_levels - cell_level);
    for (int a = 0; a < 3; ++a) {
      low[a] = triangle.low(a) >> shift;
      high[a] = triangle.high(a) >> shift;
    }
  }
  bool is_inside_grid() const {
    bool inside = true;
    for (int a = 0; a < 3; ++a) inside &= low[a] >= 0 && high[a] >> level == 0;
    return inside;
  }
  // Returns the smallest cube that contains all of these cells. The cells must be inside the grid.
  Cube cube_around() const {
    uint32_t up = 0;
    for (int a = 0; a < 3; ++a)
      while (low[a] >> up != high[a] >> up) ++up;
    const Cube lowest{level,
                      {static_cast<uint32_t>(low[0]), static_cast<uint32_t>(low[1]),
                       static_cast<uint32_t>(low[2])}};
    return ancestor(lowest, level - up);
  }

  uint32_t level;
  int64_t low[3], high[3];
};

// Returns a mask whose bit c is set if the triangle touches child c of the cube. `parent_units` is
// the cube's edge in lattice units. The triangle must touch the cube itself.
inline uint32_t touched_children(const FixedTriangle& triangle, const Cube& cube,
                                 int64_t parent_units) {
  const int64_t half = parent_units / 2;
  uint32_t mask = 0xff;
  bool inside = true;
  int64_t low[3];
  static constexpr uint32_t kLowHalf[3] = {0x0f, 0x33, 0x55};  // lower children along each axis
  for (int a = 0; a < 3; ++a) {
    low[a] = static_cast<int64_t>(cube.position[a]) * parent_units;
    const int64_t middle = low[a] + half;
    const int64_t first = triangle.low(a), last = triangle.high(a);
    if (first > middle) mask &= ~kLowHalf[a];
    if (last < middle) mask &= kLowHalf[a];
    inside &= first >= low[a] && last <= low[a] + parent_units;
  }
  if ((mask & (mask - 1)) == 0) return mask;  // the triangle's box is inside one child
  // The triangle is inside the cube, and its box crosses exactly one of the cube's three middle
  // planes. So the triangle crosses this plane and touches both children.
  if (inside && popcount64(mask) == 2) return mask;
  uint32_t touched = 0;
  for (uint32_t rest = mask; rest; rest &= rest - 1) {
    const int c = lowest_bit(rest);
    const int64_t corner[3] = {low[0] + ((c >> 2) & 1) * half, low[1] + ((c >> 1) & 1) * half,
                               low[2] + (c & 1) * half};
    if (triangle_touches_cube(triangle, corner, half)) touched |= 1u << c;
  }
  return touched;
}

}  // namespace voxdag
