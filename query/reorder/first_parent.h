// Writes the levels of a file in the order by first parent (docs/format.md, "Node order"), from the
// root down to the bricks.
//
// Each level has a queue: its nodes in the order of the output file, but with the child pointers of
// the input file. A pass over the queue of a level does two things. It writes the level with new
// pointers. And it adds each child that it meets for the first time to the queue of the next level,
// which gives the child its new offset.
//
// If the nodes of the next level fit in memory, they are read directly (forwarded_level.h).
// Otherwise, the pointers are distributed to windows of the next level (windowed_level.h), and the
// queue is passed three times.
#pragma once

#include <cstdint>
#include <memory>

#include "core/base/progress.h"
#include "core/format/global/global_writer.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"
#include "query/reorder/word_queue.h"

namespace voxdag::query {

class FirstParentOrder {
 public:
  // All arguments must outlive this object. A level is kept in memory if it needs at most
  // `level_bytes`. Otherwise, it is divided into windows, whose lists are in `space`.
  FirstParentOrder(DagInput& input, const SpillSpace& space, uint64_t level_bytes,
                   GlobalFileWriter& out, Progress& progress, const CancelToken& cancel)
      : input_(input),
        space_(space),
        level_bytes_(level_bytes),
        out_(out),
        progress_(progress),
        cancel_(cancel) {}

  // Writes all levels. The file must have voxels. Throws Error{kCorrupt} if a child pointer does
  // not refer to a node, or if a node has no parent.
  void write_levels();

 private:
  // Write `level`, whose queue is `nodes`. Return the queue of the next level.
  std::unique_ptr<WordQueue> write_in_memory(uint32_t level, const WordQueue& nodes);
  std::unique_ptr<WordQueue> write_in_windows(uint32_t level, const WordQueue& nodes);
  void write_bricks(const WordQueue& bricks);
  bool is_wide(uint32_t level) const;  // true if the nodes of `level` have 64-bit pointers
  template <class Visit>
  void visit(uint32_t level, const WordQueue& nodes, const Visit& visit_node);
  // Adds a node of `level` to `queue`, the queue of this level. Returns the new offset of the node.
  uint64_t place(uint32_t level, std::span<const uint32_t> words, WordQueue& queue) const;

  DagInput& input_;
  const SpillSpace& space_;
  const uint64_t level_bytes_;
  GlobalFileWriter& out_;
  Progress& progress_;
  const CancelToken& cancel_;
};

}  // namespace voxdag::query
