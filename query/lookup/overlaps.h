// Collision queries: tests whether a box or a capsule overlaps a set cell. Coordinates are in
// voxels of the finest grid. A shape that only touches a cell does not overlap it. Shapes may
// extend beyond the grid.
#pragma once

#include <array>
#include <cstdint>

#include "query/dag/dag_view.h"

namespace voxdag::query {

struct OverlapBox {
  std::array<double, 3> low, high;
};

// All points whose distance from the segment between `from` and `to` is less than `radius`. If both
// ends are equal, the capsule is a sphere.
struct Capsule {
  std::array<double, 3> from, to;
  double radius;
};

// Return true if the shape overlaps a set cell of the grid with 2^grid_levels cells per edge. Throw
// Error{kInvalidInput} if the file does not have this grid, or if a number of the shape is not
// finite. Throw Error{kCorrupt} if the file is damaged.
bool overlaps(const DagView& dag, uint32_t grid_levels, const OverlapBox& box);
bool overlaps(const DagView& dag, uint32_t grid_levels, const Capsule& capsule);

}  // namespace voxdag::query
