// Writes the levels of a file in the order by first parent, from the root down to the bricks.
//
// A level is first a queue: its nodes in the new order, with the pointers of the input file. A pass
// over the queue replaces each pointer by the new offset of its node, and writes the level. A node
// of the next level that is met for the first time is placed: it becomes the last node of the next
// level's queue. The next level is either in memory during the pass (forwarded_level.h), or if it
// does not fit, the pointers are sorted on the disk:
//
//   1. by their targets, which gives the first pointer to each target;
//   2. the targets by their first pointers, which is their new order and gives their new offsets;
//   3. by their places, which gives the new pointers in the order in which they are written.
#pragma once

#include <cstdint>
#include <memory>

#include "core/base/progress.h"
#include "core/format/global/global_writer.h"
#include "query/combine/dag_input.h"
#include "query/combine/spill.h"
#include "query/reorder/word_queue.h"

namespace voxdag::query {

class FirstParentOrder {
 public:
  // A level is in memory if it takes at most `level_bytes`. `space` is for the sorted pointers.
  FirstParentOrder(DagInput& input, const SpillSpace& space, uint64_t level_bytes,
                   GlobalFileWriter& out, Progress& progress, const CancelToken& cancel)
      : input_(input),
        space_(space),
        level_bytes_(level_bytes),
        out_(out),
        progress_(progress),
        cancel_(cancel) {}

  // Writes all levels. Requires that the file has voxels. Throws Error{kCorrupt} if a pointer does
  // not refer to a node, or if nodes cannot be reached from the root.
  void write_levels();

 private:
  // Returns the queue of the level after the level of `nodes`, and writes the level of `nodes`.
  std::unique_ptr<WordQueue> write_in_memory(uint32_t level, const WordQueue& nodes);
  std::unique_ptr<WordQueue> write_by_sorting(uint32_t level, const WordQueue& nodes);
  void write_bricks(const WordQueue& bricks);
  bool is_wide(uint32_t level) const;  // true if pointers in the level have 64 bits
  template <class Visit>
  void visit(uint32_t level, const WordQueue& nodes, const Visit& visit_node);
  // Adds a node to the queue of `level`, and returns its new offset.
  uint64_t place(uint32_t level, std::span<const uint32_t> words, WordQueue& queue) const;

  DagInput& input_;
  const SpillSpace& space_;
  const uint64_t level_bytes_;
  GlobalFileWriter& out_;
  Progress& progress_;
  const CancelToken& cancel_;
};

}  // namespace voxdag::query
