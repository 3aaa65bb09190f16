// One level of the top tree: the nodes whose children are subvolumes' roots or other top nodes. It
// takes part in the sweep of its level as one more run, its children already positions.
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/cube.h"
#include "merge/load/level_run.h"

namespace voxdag {

// A node whose place in the grid and in the merged level are known.
struct PlacedNode {
  Cube cube;
  uint64_t hash = 0;  // cut
  uint32_t position = 0;
};

class TopRun : public LevelRun {
 public:
  // The parents of `children`, which are all top nodes and roots of the level below. Two children
  // in one place are Error{kCorrupt}: subvolumes overlap.
  TopRun(uint32_t hash_bits, std::vector<PlacedNode> children);
  void read_frame(size_t index, Frame& out) const override;

  // The cube of each row, and its hash.
  const Cube& cube(size_t row) const { return nodes_[row].cube; }
  uint64_t hash(size_t row) const { return nodes_[row].hash; }

 private:
  struct Node {
    Cube cube;
    uint64_t hash = 0;
    uint8_t mask = 0;
    uint32_t children[8] = {};
  };

  void add_parents(const std::vector<PlacedNode>& children, uint32_t hash_bits);
  void cut_frames();

  std::vector<Node> nodes_;  // in the total order; equal ones stay apart until the sweep
  std::vector<FrameInfo> infos_;
};

}  // namespace voxdag
