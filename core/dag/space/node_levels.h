// A sub-DAG in memory whose nodes are found by their rows. The *depth* of a level counts from the
// root, which has depth 0 and row 0. The last depth has the bricks.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/popcount8.h"
#include "core/dag/consing/pooled_memory.h"

namespace voxdag {

struct NodeLevels {
  struct Level {
    uint64_t rows = 0;
    PooledArray<uint8_t> masks;
    PooledArray<uint32_t> first_child;  // index in `children`
    PooledArray<uint32_t> children;     // rows of the next depth
  };
  std::vector<Level> nodes;  // by depth; empty if the root is a brick
  PooledArray<uint64_t> bricks;
  uint64_t brick_rows = 0;

  int brick_depth() const { return static_cast<int>(nodes.size()); }
  uint64_t rows(int depth) const {
    return depth == brick_depth() ? brick_rows : nodes[static_cast<size_t>(depth)].rows;
  }
  bool has_child(int depth, uint32_t row, int octant) const {
    return nodes[static_cast<size_t>(depth)].masks[row] >> octant & 1;
  }
  // Returns the row of a child that exists.
  uint32_t child(int depth, uint32_t row, int octant) const {
    const Level& level = nodes[static_cast<size_t>(depth)];
    const uint32_t before = level.masks[row] & ((1u << octant) - 1);
    return level.children[level.first_child[row] + static_cast<uint32_t>(popcount8(before))];
  }
};

}  // namespace voxdag
