// Moves a file by a whole number of voxels into the grid of another file.
//
// A cube of the new file overlaps up to 2 x 2 x 2 cubes of the moved file that have the same edge.
// These cubes are the *group* of the new cube. On each level, all new cubes have the same position
// relative to their groups, so new cubes with equal groups have equal contents. Therefore
// MovedLevels finds the distinct groups level by level, from the root down, and divides each only
// once. On an axis on which the offset is a multiple of the cubes' edge, a group has only one cube.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "query/combine/pair_levels.h"
#include "query/combine/result_rows.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

// Finds the distinct groups of all levels. Returns them in the form of pairs (pair_levels.h), so
// that LevelsWriter can write the moved file like a combined file.
class MovedLevels {
 public:
  // The input's voxel (0, 0, 0) is placed at `offset` in a grid of 2^levels voxels per edge. The
  // input may have another resolution.
  MovedLevels(DagInput& input, uint32_t levels, const std::array<int64_t, 3>& offset,
              uint32_t hash_bits, const SpillSpace& space)
      : input_(input), levels_(levels), offset_(offset), hash_bits_(hash_bits), space_(space) {}

  // Descends from the root to the bricks. Returns the places (result_rows.h) that use each group,
  // by level; index 0 is the root's level. Adds the new bricks to `bricks`.
  std::vector<std::unique_ptr<PairLevel>> descend(BrickResults& bricks);

 private:
  // Word offsets of the cubes of a group; kNoNode for an empty cube. The index is 4x + 2y + z,
  // where x, y and z are 0 or 1.
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
  // Returns the input's level whose cubes have the same edge as the cubes of the new file's
  // `level`. The result is negative if these cubes are larger than the input's grid.
  int64_t input_level(uint32_t level) const {
    return static_cast<int64_t>(input_.file().grid_levels()) - levels_ + level;
  }
  // Returns the distance in voxels, along `axis`, from the low face of a group's first cube to the
  // low face of the new cube. It is the same for all cubes of the new file's `level`.
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

// True if a voxel of `file` is outside of a grid with `resolution` voxels per edge when the file's
// voxel (0, 0, 0) is placed at the grid's voxel `offset`. Visits only cubes at the grid's faces,
// and at most 2^18 of them: returns false if it finds no such voxel in these. Throws
// voxdag_reader::Error.
bool has_voxels_outside(const voxdag_reader::File& file, const std::array<int64_t, 3>& offset,
                        int64_t resolution);

}  // namespace voxdag::query
