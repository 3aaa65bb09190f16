// Collision queries: tests whether a box or a capsule overlaps a set cell. Coordinates are in
// voxels of the file's grid. A shape that only touches a cell does not overlap it. The shape may
// extend beyond the grid.
#pragma once

#include <array>
#include <cstdint>

#include "query/dag/dag_view.h"

namespace voxdag::query {

struct OverlapBox {
  std::array<double, 3> low, high;
};

// All points whose distance from the segment is less than `radius`. A sphere has from == to.
struct Capsule {
  std::array<double, 3> from, to;
  double radius;
};

// Return true if the shape overlaps a set cell of the grid of 2^grid_levels cells per edge. Throw
// Error{kInvalidInput} if the file has no such grid or a number is not finite, and Error{kCorrupt}.
bool overlaps(const DagView& dag, uint32_t grid_levels, const OverlapBox& box);
bool overlaps(const DagView& dag, uint32_t grid_levels, const Capsule& capsule);

}  // namespace voxdag::query
