// Verifies the checksum blocks of nodes and bricks before they are read. If `blocks` is null, all
// nodes and bricks count as intact.
#pragma once

#include <cstdint>

#include "core/format/global/checked_blocks.h"
#include "query/dag/dag_view.h"

namespace voxdag::query {

class NodeChecks {
 public:
  NodeChecks(const DagView& dag, uint32_t level, const CheckedBlocks* blocks) : blocks_(blocks) {
    if (!blocks) return;
    const bool is_brick = level + kBrickLevels == dag.grid_levels();
    words_ = dag.level(level).words.size();
    place_ = blocks->place_of(dag.level(level).words.data());
    bytes_ = 4 * (is_brick ? 2 : dag.level(level + 1).wide ? 17 : 9);
  }

  // Throws DamagedBlock if the node or brick at this word offset is damaged. The offset may have
  // any value; an offset outside the level is not checked. Checks the bytes of a node of maximum
  // size, because the first word, which determines the node's size, can itself be damaged.
  void expect_intact(uint64_t offset) const {
    if (blocks_ && offset < words_) blocks_->expect_intact_at(place_ + 4 * offset, bytes_);
  }

 private:
  const CheckedBlocks* blocks_;
  uint64_t words_ = 0, place_ = 0, bytes_ = 0;
};

}  // namespace voxdag::query
