// The rules that decide which empty voxels are inside a surface (docs/solid.md).
//
// All rules decide per unit, a connected set of empty voxels. Let B be the edge of a block: 8
// voxels, or 4 in a grid with an edge of 4 voxels. The units are
//
//   1. the maximal empty cubes of the octree with an edge of at least B;
//   2. in every aligned block of B^3 voxels that has a voxel of the shell, each 6-connected
//      component of the block's empty voxels.
//
// Corners are the corners of blocks. A sample row is a line along an axis through corners. From a
// corner, the view along an axis sums the crossings (crossing.h) of the row in both directions:
//
//   left     sum of the signs of the crossings before the corner
//   total    sum of the signs of all crossings of the row
//   winding  view = left - (total - left)
//   parity   view = (left mod 2) + ((total - left) mod 2)
//
// Each corner contributes the sum of its three views. A unit with k corners is inside iff the
// absolute value of the sum over all its corners is > 3 k. A view has two directions. If every
// direction counts as 0 (outside) or 1 (inside), this means that more than half of the 6 k
// directions count as 1.
//
// A component without a corner of its block is *blind*. Its views come from a walk to the component
// from the block's low corner (BlindComponent in core/backend/cpu/solid).
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/host_device.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

enum class SolidRule { kNone, kWinding, kParity };

// Returns log2 of the edge of a block, in voxels.
VOXDAG_HD constexpr int solid_block_log2(uint32_t grid_levels) { return grid_levels < 3 ? 2 : 3; }
// Returns log2 of the distance between sample rows, in lattice units.
VOXDAG_HD constexpr int sample_pitch_log2(uint32_t grid_levels) {
  return kUnitBits + solid_block_log2(grid_levels);
}

// Returns the view along one axis from a corner. The comment at the top of this file defines the
// view, which is a number, and the sums `left` and `total`.
VOXDAG_HD constexpr int32_t view_of(SolidRule rule, int32_t left, int32_t total) {
  if (rule == SolidRule::kWinding) return 2 * left - total;
  return (left & 1) + ((total - left) & 1);
}
// Returns the view along a row from a point behind crossings of this row. `view`: the view from a
// point before these crossings. `crossings`: the sum of their signs.
VOXDAG_HD constexpr int32_t view_after(SolidRule rule, int32_t view, int32_t crossings) {
  if (rule == SolidRule::kWinding) return view + 2 * crossings;
  return (crossings & 1) != 0 ? 2 - view : view;
}
// Returns the sum of the three views from the end of a walk along any axes. `views`: this sum at
// the start of the walk. `crossings`: the sum of the signs of the walk's crossings.
VOXDAG_HD constexpr int64_t views_after(SolidRule rule, int64_t views, int64_t crossings) {
  if (rule == SolidRule::kWinding) return views + 6 * crossings;
  return (crossings & 1) != 0 ? 6 - views : views;
}

// The sum of the views from the corners of a unit, and the number of these corners.
struct UnitViews {
  int64_t sum = 0;
  int corners = 0;

  VOXDAG_HD void add(int64_t views) {
    sum += views;
    ++corners;
  }
  VOXDAG_HD bool is_inside() const { return (sum < 0 ? -sum : sum) > 3 * corners; }
  // True if the sum shows that the 6 * corners directions (see above) do not all agree. For
  // example, some count as outside and others as inside.
  VOXDAG_HD bool is_disputed() const { return sum % (6 * corners) != 0; }
};

// The two axes other than a row's axis, in the order x, y, z. The coordinates along them are the
// position of the row. Values of the rows through a square of m^2 blocks are stored as an array of
// (m + 1)^2 numbers, in which the position along the second axis varies fastest.
VOXDAG_HD constexpr int first_row_axis(int axis) { return axis == 0 ? 1 : 0; }
VOXDAG_HD constexpr int second_row_axis(int axis) { return axis == 2 ? 1 : 2; }

// A solid's rule, and for each axis the views along this axis from the corners on the low face of a
// cube.
struct SolidEntry {
  SolidRule rule = SolidRule::kNone;
  std::vector<int32_t> views[3];  // one for each sample row of the closed cube
};

}  // namespace voxdag
