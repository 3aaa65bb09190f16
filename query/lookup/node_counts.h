// Counts the set cells in regions. So that counting is fast, the constructor computes the number of
// set cells below each node, from the bricks up, and stores it: one 64-bit number per node.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/format/global/node_index.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "query/dag/selection.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// Counts the set cells of one grid. Immutable after construction; safe to use from several threads.
class NodeCounts {
 public:
  // Stores the counts. They take at most 8 bytes per node above the bricks, and 2 bits per word of
  // these nodes. If they do not fit in the budget, stores nothing; count() then visits all nodes in
  // its region. `dag` is the view of `file`; both must outlive this object. Throws Error{kCorrupt},
  // Error{kCanceled}.
  NodeCounts(const voxdag_reader::File& file, const DagView& dag, uint32_t grid_levels,
             MemoryBudget& budget, const CancelToken& cancel = {});

  bool is_stored() const { return !levels_.empty(); }
  // Returns the number of set cells in the region. Throws Error{kCorrupt}.
  uint64_t count(const Region& region) const;

 private:
  struct Level {
    NodeIndex index;
    PageBuffer<uint64_t> counts;
  };

  void store(const voxdag_reader::File& file, MemoryBudget& budget, const CancelToken& cancel);
  uint64_t count_below(uint32_t depth, uint64_t content) const;
  uint64_t sum_children(uint32_t depth, uint64_t content) const;
  uint64_t count_within(const Region& region, uint32_t depth, const Position& low,
                        uint64_t content) const;

  const DagView& dag_;
  const uint32_t grid_levels_;
  std::vector<Level> levels_;  // by depth
};

}  // namespace voxdag::query
