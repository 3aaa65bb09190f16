// Cubes of a file's empty voxels around one voxel, to check a solid whose walks are made by a cube
// of radius + 1 voxels per edge (docs/solid.md, "Enclosed"). Voxels outside the grid are empty.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/format/global/voxdag_reader.h"

namespace voxdag::query {

using VoxelPlace = std::array<int64_t, 3>;

class EmptyCubes {
 public:
  // Reads the voxels up to radius + 1 away from `center`. `edge` is the edge of the grid.
  EmptyCubes(const voxdag_reader::File& file, int64_t edge, const VoxelPlace& center, int radius);

  // True if an empty cube has the center.
  bool has_center() const;

  // The cubes that have the center's neighbor and not the center, and that one step along the axis
  // would move over the center.
  struct Step {
    bool has_cubes = false;
    std::vector<VoxelPlace> stops;  // set voxels, one of which can stop an empty cube
  };
  // Returns the step from the neighbor at center + side along the axis. `side` is 1 or -1.
  Step step_from(int axis, int side) const;

 private:
  // Returns the number of set voxels in [low, high), in places of the block that was read.
  int count(const std::array<int, 3>& low, const std::array<int, 3>& high) const;
  // True if the cube whose lowest voxel is at `low` in the block is empty.
  bool is_empty(const std::array<int, 3>& low) const;
  int& sum(int x, int y, int z) {
    return sums_[(static_cast<size_t>(x) * side_ + static_cast<size_t>(y)) * side_ +
                 static_cast<size_t>(z)];
  }
  int sum(int x, int y, int z) const { return const_cast<EmptyCubes*>(this)->sum(x, y, z); }

  const VoxelPlace center_;
  const int radius_;
  const size_t side_;      // of sums_: one more than the block's edge
  std::vector<int> sums_;  // numbers of set voxels below a place along all axes
};

}  // namespace voxdag::query
