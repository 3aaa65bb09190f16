// Cells of a file's grids. A file has a grid of 2^grid_levels cells per edge for each grid_levels
// from 0 to the file's own value. A cell is set if any voxel in it is set. In the finest grid,
// cells are voxels.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace voxdag::query {

// x, y and z in cells of a grid. In memory, an array of positions is a dense n x 3 array of int64.
using Position = std::array<int64_t, 3>;

// The half-open box low <= p < high of cells of a grid. A region may extend beyond the grid.
struct Region {
  Position low{};
  Position high{};

  bool empty() const { return low[0] >= high[0] || low[1] >= high[1] || low[2] >= high[2]; }
  // intersects() returns true if the region contains at least one cell of the cube with this low
  // corner and edge. contains() returns true if the region contains all cells of the cube.
  bool intersects(const Position& corner, int64_t edge) const {
    for (size_t axis = 0; axis < 3; ++axis)
      if (corner[axis] >= high[axis] || corner[axis] + edge <= low[axis]) return false;
    return true;
  }
  bool contains(const Position& corner, int64_t edge) const {
    for (size_t axis = 0; axis < 3; ++axis)
      if (corner[axis] < low[axis] || corner[axis] + edge > high[axis]) return false;
    return true;
  }
  friend bool operator==(const Region&, const Region&) = default;
};

// Returns the region of all cells of the grid of 2^grid_levels cells per edge.
inline Region whole_grid(uint32_t grid_levels) {
  const int64_t edge = int64_t{1} << grid_levels;
  return {{0, 0, 0}, {edge, edge, edge}};
}

// Returns the part of the region inside the grid of 2^grid_levels cells per edge; may be empty.
inline Region cut_to_grid(const Region& region, uint32_t grid_levels) {
  const int64_t edge = int64_t{1} << grid_levels;
  Region cut;
  for (size_t axis = 0; axis < 3; ++axis) {
    cut.low[axis] = std::clamp<int64_t>(region.low[axis], 0, edge);
    cut.high[axis] = std::clamp<int64_t>(region.high[axis], 0, edge);
  }
  return cut;
}

// A region of the grid of 2^grid_levels cells per edge.
struct Selection {
  uint32_t grid_levels = 0;
  Region region;
};

// 4x4x4 cells of a grid. Cell (x, y, z) of the brick is bit 32x1 + 16y1 + 8z1 + 4x0 + 2y0 + z0 of
// the mask, where x1 and x0 are the high and the low bit of x.
struct Brick {
  Position low;  // low corner in cells, a multiple of 4
  uint64_t mask;
};

}  // namespace voxdag::query
