// One step (steps.h) of a dilation or an erosion of a file.
//
// A cube of the result depends on a *group* of up to 2 x 2 x 2 cubes of the file with the same
// edge: on each axis, on the cube at the same place and on one neighbor. If a jump is longer than
// the edge, the neighbor is at the distance of the jump; otherwise it is the adjacent cube. Cubes
// with equal groups have equal results. Therefore NeighborLevels finds the distinct groups level by
// level, from the root down, and divides each only once. It computes the result of each group of
// bricks immediately, so that only distinct bricks are sorted.
//
// Many groups have the same result for a known reason, and are replaced by one of them:
//
//   - A dilated full cube is full.
//   - If the jump is at least as long as the edge, the result is the union or the intersection of
//     the cubes of the group. Then their order and repetitions do not matter.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/progress.h"
#include "query/combine/pair_levels.h"
#include "query/combine/result_rows.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"
#include "query/morphology/steps.h"

namespace voxdag::query {

class NeighborLevels {
 public:
  NeighborLevels(DagInput& input, const MorphologyStep& step, const SpillSpace& space);

  // Descends from the root to the bricks. Returns the places (result_rows.h) that use each group,
  // by level; index 0 is the root's level. Adds the new bricks to `bricks`. Advances `progress` by
  // 1 for each level.
  std::vector<std::unique_ptr<PairLevel>> descend(BrickResults& bricks, Progress& progress);
  uint64_t group_count() const { return group_count_; }

 private:
  // Stands for a cube outside of the grid if MorphologyStep::is_outside_set is true.
  static constexpr uint64_t kOutside = kNoNode - 1;
  // Word offsets of the cubes of a group; kNoNode for an empty cube. A cube outside of the grid has
  // the number kOutside, or kNoNode if MorphologyStep::is_outside_set is false.
  // The index is 4x + 2y + z, where x, y and z are 1 for the neighbor on this axis and otherwise 0.
  using Cubes = std::array<uint64_t, 8>;
  // A place (result_rows.h) whose result is the result of a group, or a brick given by its mask.
  template <class Content>
  struct Request {
    Content content;
    uint64_t place;
    friend bool operator<(const Request& a, const Request& b) {
      return a.content != b.content ? a.content < b.content : a.place < b.place;
    }
  };
  struct Open {
    Open(uint32_t opened, const SpillSpace& space)
        : level(opened),
          requests(space),
          bricks(space),
          result(std::make_unique<PairLevel>(space)) {}
    uint32_t level;
    SpillSorter<Request<Cubes>> requests;
    SpillSorter<Request<uint64_t>> bricks;  // used only on the level of the bricks
    std::unique_ptr<PairLevel> result;
  };

  uint64_t edge(uint32_t level) const { return uint64_t{1} << (levels_ - level); }
  bool is_brick_level(uint32_t level) const { return level + 2 == levels_; }
  // True if the neighbors in a group of this level are adjacent cubes.
  bool is_adjacent(uint32_t level) const {
    return step_.is_window || edge(level) >= step_.distance;
  }
  // True if the result of a group is the union or the intersection of its cubes.
  bool is_exact(uint32_t level) const { return !step_.is_window && edge(level) <= step_.distance; }
  uint64_t outside() const { return step_.is_outside_set ? kOutside : kNoNode; }
  void find_full_nodes();
  void find_sources();
  bool normalize(uint32_t level, Cubes& cubes) const;
  bool make_exact(uint32_t level, Cubes& cubes) const;
  void add(Open& to, Cubes cubes, uint64_t place) const;
  template <class Content, class Visit>
  void number(SpillSorter<Request<Content>>& requests, PairLevel& result, const Visit& visit) const;
  void expand_groups(Open& level, Open& below);
  uint64_t brick(const Cubes& cubes) const;
  void add_bricks(Open& level, BrickResults& bricks) const;

  DagInput& input_;
  const uint32_t levels_;
  const MorphologyStep step_;
  const SpillSpace& space_;
  // For each level: the node in which all voxels are set, or kNoNode.
  std::vector<uint64_t> full_;
  // For each child of a cube and each index of its group: the index of the cube in the parent's
  // group, and the child of this cube. It depends only on whether the neighbors on the child's
  // level are adjacent.
  struct Source {
    uint8_t cube, child;
  };
  std::array<std::array<std::array<Source, 8>, 8>, 2> sources_;
  uint64_t group_count_ = 0;
};

}  // namespace voxdag::query
