// Counts the set cells in the grids of a file's levels, from the coarsest grid to finer grids. For
// each node of one level, the class stores how often the node occurs in the octree, and computes
// the numbers of the next level from them. So each level above the requested grid is read only
// once.
#pragma once

#include <cstdint>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/format/global/node_index.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// Used by one thread.
class LevelCells {
 public:
  // `dag` is the view of `file`, which must have voxels. All references must outlive this object.
  LevelCells(const voxdag_reader::File& file, const DagView& dag, MemoryBudget& budget,
             const CancelToken& cancel)
      : file_(file), dag_(dag), budget_(budget), cancel_(cancel) {}

  // Returns the number of set cells in the grid of 2^grid_levels cells per edge. Stops counting
  // above `limit`: the result is then an arbitrary number over `limit`. `grid_levels` must be at
  // least 2, less than the number of levels of the file's grid, and not less than in the previous
  // call. Takes 8 bytes for each node that is two or three levels above the cells, and 2 bits for
  // each word of these nodes. Throws Error{kOutOfMemory} if this is over the budget, and
  // Error{kCorrupt} for a damaged file.
  uint64_t count(uint32_t grid_levels, uint64_t limit);

 private:
  // The nodes of a level. `places` has the number of occurrences of each node in the octree.
  struct Level {
    NodeIndex index;
    PageBuffer<uint64_t> places;
  };

  Level level(uint32_t depth) const;
  // Calls visit(children, places) for each node of level_ that begins in the span (node_index.h)
  // with the number `span`. `places` is the node's number of occurrences.
  template <class Visit>
  void visit_span(uint64_t span, const Visit& visit) const;
  void descend();

  const voxdag_reader::File& file_;
  const DagView& dag_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  uint32_t depth_ = 0;  // depth of level_
  Level level_;         // empty before the first count
};

}  // namespace voxdag::query
