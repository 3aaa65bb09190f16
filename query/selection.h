// Which part of a file a command or a query means: the grid of one of its octree's levels, and a
// box of that grid.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

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

// The cells of a grid of 2^grid_levels per edge, a cell being set where any voxel of the file in it
// is, that lie in a region of that grid.
struct Selection {
  uint32_t grid_levels = 0;
  Region region;
};

// Throws Error{kInvalidInput} for a grid that is finer than that of a file of so many levels, or
// coarser than a brick.
void check_grid(const Selection& selection, uint32_t file_levels);

}  // namespace voxdag::query
