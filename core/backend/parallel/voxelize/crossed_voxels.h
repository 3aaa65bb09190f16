// The voxels of a brick that the rule kThin sets for a triangle (core/geometry/crossing.h).
#pragma once

#include <cstdint>

#include "core/backend/parallel/voxelize/triangle_cells.h"
#include "core/base/host_device.h"
#include "core/dag/brick.h"
#include "core/geometry/crossing.h"

namespace voxdag::parallel {

// Returns the voxels of a brick in which a triangle crosses the row along `axis` through the
// voxel's center, as bits numbered by cell_bit(). `test` is a RowTest (crossing.h) of the triangle
// and the axis. `low` is the brick's low corner in lattice units.
template <class Test>
VOXDAG_HD inline uint64_t crossed_along(const Test& test, int axis, const int64_t (&low)[3]) {
  const int b = (axis + 1) % 3, c = (axis + 2) % 3;
  const int64_t first_voxel = low[axis] >> kUnitBits;
  uint64_t voxels = 0;
  for (int i = 0; i < kBrickEdge; ++i)
    for (int j = 0; j < kBrickEdge; ++j) {
      const int64_t at_b = low[b] + i * kUnitsPerVoxel + kUnitsPerVoxel / 2;
      const int64_t at_c = low[c] + j * kUnitsPerVoxel + kUnitsPerVoxel / 2;
      if (!test.crosses(at_b, at_c)) continue;
      const int64_t k = test.first_beyond(at_b, at_c, kUnitBits) - 1 - first_voxel;
      if (k < 0 || k >= kBrickEdge) continue;
      voxels |=
          uint64_t{1} << (cell_bit(axis, static_cast<int>(k)) + cell_bit(b, i) + cell_bit(c, j));
    }
  return voxels;
}

template <class Test>
VOXDAG_HD inline uint64_t crossed_voxels_by(const FixedTriangle& t, const int64_t (&low)[3]) {
  uint64_t voxels = 0;
  for (int axis = 0; axis < 3; ++axis) voxels |= crossed_along(Test(t, axis), axis, low);
  return voxels;
}

// Returns the voxels of the brick with the low corner `low` that the rule kThin sets.
VOXDAG_HD inline uint64_t crossed_voxels(const FixedTriangle& t, const int64_t (&low)[3]) {
  if (!box_touches_cube(t, low, kUnitBits + kBrickLevels)) return 0;
  if (!has_row_coordinates(t)) return crossed_voxels_by<WideRowTest>(t, low);
  if (!has_row_extents(t)) return crossed_voxels_by<GridRowTest>(t, low);
  return crossed_voxels_by<NarrowRowTest>(t, low);
}

}  // namespace voxdag::parallel
