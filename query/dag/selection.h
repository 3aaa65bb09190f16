// Which part of a file a command or a query means: the grid of one of its octree's levels, and a
// box of that grid.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "core/format/global/voxdag_reader.h"

namespace voxdag::query {

// The half-open box low <= p < high of cells of a grid.
struct Region {
  std::array<int64_t, 3> low{};
  std::array<int64_t, 3> high{};

  bool empty() const { return low[0] >= high[0] || low[1] >= high[1] || low[2] >= high[2]; }
  // Whether the region has a cell of, or all of, the cube with that low corner and edge.
  bool intersects(const std::array<int64_t, 3>& corner, int64_t edge) const {
    for (size_t axis = 0; axis < 3; ++axis)
      if (corner[axis] >= high[axis] || corner[axis] + edge <= low[axis]) return false;
    return true;
  }
  bool contains(const std::array<int64_t, 3>& corner, int64_t edge) const {
    for (size_t axis = 0; axis < 3; ++axis)
      if (corner[axis] < low[axis] || corner[axis] + edge > high[axis]) return false;
    return true;
  }
  friend bool operator==(const Region&, const Region&) = default;
};

// All cells of a grid of 2^grid_levels per edge.
inline Region whole_grid(uint32_t grid_levels) {
  const int64_t edge = int64_t{1} << grid_levels;
  return {{0, 0, 0}, {edge, edge, edge}};
}

// What of the region lies in that grid; empty if nothing does.
inline Region cut_to_grid(const Region& region, uint32_t grid_levels) {
  const int64_t edge = int64_t{1} << grid_levels;
  Region cut;
  for (size_t axis = 0; axis < 3; ++axis) {
    cut.low[axis] = std::clamp<int64_t>(region.low[axis], 0, edge);
    cut.high[axis] = std::clamp<int64_t>(region.high[axis], 0, edge);
  }
  return cut;
}

// The cells of a grid of 2^grid_levels per edge, a cell being set where any voxel of the file in it
// is, that lie in a region of that grid.
struct Selection {
  uint32_t grid_levels = 0;
  Region region;
};

// Where a coordinate of world space lies along an axis of the grid of 2^grid_levels cells per edge,
// in cells. What lies on a boundary between cells up to the rounding of a few operations in doubles
// lies on it: so the corner of a cell, computed as origin + cell * edge, is in that cell, and a box
// of such corners has no layer more than that.
double world_to_cells(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world);
// The cell that it lies in, which may lie outside of the grid; at most 2^62 away.
int64_t world_to_cell(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world);
// The cells that the half-open box x0, y0, z0, x1, y1, z1 of world space reaches, of numbers; where
// it is infinite it ends with the grid.
Region world_to_region(const voxdag_reader::File& file, uint32_t grid_levels,
                       const std::array<double, 6>& box);

// Throws Error{kInvalidInput} for a grid that is finer than that of a file of so many levels, or
// coarser than a brick.
void check_grid(const Selection& selection, uint32_t file_levels);

}  // namespace voxdag::query
