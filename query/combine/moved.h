// Moves a file by a whole number of voxels in the grid of another file.
//
// A cube of the new file overlaps up to 2 x 2 x 2 cubes of the moved file, always at the same
// position relative to them. So the nodes of a level are made from the distinct groups of these
// cubes, level by level: every group is divided once, wherever it occurs. A group has one cube
// along each axis in which the offset is a multiple of the cubes' edge.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "query/combine/dag_input.h"
#include "query/combine/pair_levels.h"
#include "query/combine/result_rows.h"
#include "query/combine/spill.h"

namespace voxdag::query {

// Finds the groups of cubes. The results of groups are like the results of pairs.
class MovedLevels {
 public:
  // Voxel (0, 0, 0) of the input comes to `offset` in a grid of 2^levels voxels per edge. The input
  // may have another resolution.
  MovedLevels(DagInput& input, uint32_t levels, const std::array<int64_t, 3>& offset,
              uint32_t hash_bits, const SpillSpace& space)
      : input_(input), levels_(levels), offset_(offset), hash_bits_(hash_bits), space_(space) {}

  // Returns all levels, from the root to the bricks, and adds the results of groups of bricks.
  std::vector<std::unique_ptr<PairLevel>> descend(BrickResults& bricks);

 private:
  // Word offsets of cubes; the first index is for the first axis.
  using Cubes = std::array<uint64_t, 8>;
  struct Request {
    Cubes cubes;
    uint64_t place;
    friend bool operator<(const Request& a, const Request& b) {
      return a.cubes != b.cubes ? a.cubes < b.cubes : a.place < b.place;
    }
  };
  struct Open {
    Open(uint32_t opened, const SpillSpace& space)
        : level(opened),
          groups(std::make_unique<SpillList<Cubes>>(space)),
          requests(std::make_unique<SpillSorter<Request>>(space)),
          result(std::make_unique<PairLevel>(space)) {}
    uint32_t level;
    std::unique_ptr<SpillList<Cubes>> groups;
    std::unique_ptr<SpillSorter<Request>> requests;
    std::unique_ptr<PairLevel> result;
  };

  int64_t edge(uint32_t level) const { return int64_t{1} << (levels_ - level); }
  // Returns the input's level with cubes of the same edge; negative for cubes larger than its grid.
  int64_t input_level(uint32_t level) const {
    return static_cast<int64_t>(input_.file().grid_levels()) - levels_ + level;
  }
  int64_t remainder(uint32_t level, size_t axis) const {
    return -offset_[axis] & (edge(level) - 1);
  }
  Cubes root() const;
  uint64_t cube_at(const std::array<int64_t, 3>& index) const;
  std::array<uint64_t, 8> children(uint32_t level, uint64_t cube) const;
  void add(Open& to, const Cubes& cubes, uint64_t place) const;
  void number_groups(Open& level) const;
  void expand_groups(const Open& level, Open& below) const;
  uint64_t brick(const Cubes& cubes) const;
  void add_bricks(const Open& level, BrickResults& bricks) const;

  DagInput& input_;
  const uint32_t levels_;
  const std::array<int64_t, 3> offset_;
  const uint32_t hash_bits_;
  const SpillSpace& space_;
};

}  // namespace voxdag::query
