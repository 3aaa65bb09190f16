// The nodes of the level with 32^3 cells, in a dense array of 256 KiB. Lookups of many points begin
// at these nodes instead of at the root. If the scene consists of surfaces, most lookups also end
// there, in empty cells.
#pragma once

#include <cstdint>
#include <vector>

#include "core/dag/brick.h"
#include "query/dag/dag_view.h"

namespace voxdag::query {

class TopCells {
 public:
  static constexpr uint32_t kLevels = 5;

  // True if the DAG has nodes on the level of 32^3 cells, and the grid of 2^grid_levels cells per
  // edge is finer than this level.
  static bool serve(const DagView& dag, uint32_t grid_levels) {
    return !dag.empty() && dag.grid_levels() > kLevels + kBrickLevels && grid_levels > kLevels;
  }

  // `dag` must satisfy serve(). Reads the DAG's levels above the 32^3 cells. Throws Error{kCorrupt}
  // if these levels are damaged.
  explicit TopCells(const DagView& dag) : cells_(size_t{1} << (3 * kLevels)) {
    fill(dag, 0, dag.root(), 0);
  }

  struct Cell {
    uint64_t word;
    uint32_t mask() const { return word & 255; }  // 0 if there is no node
    uint64_t offset() const { return word >> 8; }
  };
  // Coordinates are less than 2^kLevels.
  Cell at(uint32_t x, uint32_t y, uint32_t z) const {
    return {cells_[(x << kLevels | y) << kLevels | z]};
  }

 private:
  // Fills the array below a node. `place` is the array index of the low corner of the node's cell.
  void fill(const DagView& dag, uint32_t depth, uint64_t offset, size_t place) {
    const DagView::Children children = dag.children_of_node(depth, offset);
    if (depth == kLevels) {
      cells_[place] = offset << 8 | children.mask;
      return;
    }
    const uint32_t shift = kLevels - 1 - depth;
    for (int i = 0; i < 8; ++i) {
      if (!children.has(i)) continue;
      const auto bits = static_cast<size_t>(i);
      const size_t step = (bits >> 2) << (2 * kLevels) | (bits >> 1 & 1) << kLevels | (bits & 1);
      fill(dag, depth + 1, dag.offset(children, i), place + (step << shift));
    }
  }

  std::vector<uint64_t> cells_;
};

}  // namespace voxdag::query
