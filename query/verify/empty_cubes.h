// Finds the empty cubes of radius + 1 voxels per edge near one voxel, which is called the center. A
// cube is empty if none of its voxels is set. A check of enclosed solids uses these cubes: a walk
// (docs/solid.md, "Enclosed") is a sequence of steps of such a cube. Voxels outside the grid are
// empty.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/format/global/voxdag_reader.h"

namespace voxdag::query {

using VoxelPlace = std::array<int64_t, 3>;

class EmptyCubes {
 public:
  // Reads a block of voxels from the file: all voxels whose distance from `center` is at most
  // radius + 1 along each axis. `edge` is the number of voxels per edge of the grid.
  EmptyCubes(const voxdag_reader::File& file, int64_t edge, const VoxelPlace& center, int radius);

  // True if an empty cube contains the center.
  bool has_center() const;

  // A step of all empty cubes that are next to one side of the center. Each of them would contain
  // the center after a move by one voxel toward the center.
  struct Step {
    bool has_cubes = false;
    std::vector<VoxelPlace> stops;  // set voxels that at least one of the cubes would move over
  };
  // Returns the step of the cubes on one side of the center: with higher coordinates along `axis`
  // if `side` is 1, with lower ones if it is -1.
  Step step_from(int axis, int side) const;

 private:
  // Returns the number of set voxels in [low, high). Positions count from the block's low corner.
  int count(const std::array<int, 3>& low, const std::array<int, 3>& high) const;
  // True if the cube of radius + 1 voxels per edge with the low corner `low` has no set voxel.
  bool is_empty(const std::array<int, 3>& low) const;
  int& sum(int x, int y, int z) {
    return sums_[(static_cast<size_t>(x) * side_ + static_cast<size_t>(y)) * side_ +
                 static_cast<size_t>(z)];
  }
  int sum(int x, int y, int z) const { return const_cast<EmptyCubes*>(this)->sum(x, y, z); }

  const VoxelPlace center_;
  const int radius_;
  const size_t side_;      // edge of sums_: the edge of the block, plus 1
  std::vector<int> sums_;  // by position: number of set voxels with lower coordinates on all axes
};

}  // namespace voxdag::query
