// A run with one level of the top tree: nodes whose children are roots of subvolumes or other top
// nodes. The merge treats it like the runs of the artifacts, except that its children are already
// positions (row.h).
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/cube.h"
#include "merge/load/level_run.h"

namespace voxdag {

// A node with its cube in the grid and its position in the merged level.
struct PlacedNode {
  Cube cube;
  uint64_t hash = 0;  // truncated to hash_bits
  uint64_t position = 0;
};

class TopTreeRun : public LevelRun {
 public:
  // Creates the parents of `children`, which are all top nodes and all subvolume roots of the
  // level below. `wide`: the children's positions take two words. Throws Error{kCorrupt} if two
  // children have the same cube, because then their subvolumes overlap.
  TopTreeRun(uint32_t hash_bits, std::vector<PlacedNode> children, bool wide);
  void read_frame(size_t index, Frame& out) const override;

  const Cube& cube(size_t row) const { return nodes_[row].cube; }
  uint64_t hash(size_t row) const { return nodes_[row].hash; }

 private:
  struct Node {
    Cube cube;
    uint64_t hash = 0;
    uint8_t mask = 0;
    uint64_t children[8] = {};  // positions
    std::span<const uint64_t> child_span() const { return {children, kPopcount8[mask]}; }
  };

  void add_parents(const std::vector<PlacedNode>& children, uint32_t hash_bits);
  void divide_into_frames();

  std::vector<Node> nodes_;  // in the total order, including equal nodes
  std::vector<FrameInfo> infos_;
};

}  // namespace voxdag
