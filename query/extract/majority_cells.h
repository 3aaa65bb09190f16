// Finds the cells of a coarser grid in which at least half of the voxels are set.
//
// The number of voxels below each node is computed once per node of the DAG, from the bricks up to
// the level of the cells. The nodes are read in the order of the file. If the numbers of a level do
// not fit in memory, they are in a scratch file (query/combine/spill/node_values.h). This class
// finally keeps only one bit for each two words of the cells' level, which is enough because every
// node has at least two words.
//
// If the cells have two voxels per edge, they are octants of bricks, and this class needs no bits.
// Immutable after construction; safe to use from several threads.
#pragma once

#include <cstdint>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "merge/load/scratch_file.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

class MajorityCells {
 public:
  // `grid_levels` must be less than the number of levels of the file's grid. The bits remain
  // charged to `budget`. Throws Error{kCorrupt}, Error{kCanceled}, Error{kOutOfMemory},
  // Error{kNoSpace} and voxdag_reader::Error.
  MajorityCells(const voxdag_reader::File& file, uint32_t grid_levels, ScratchFolder& folder,
                MemoryBudget& budget, Progress& progress, const CancelToken& cancel);

  // Returns a mask of a brick's octants in which at least half of the voxels are set.
  static uint8_t octants(uint64_t mask);
  // Returns a mask of a node's children in which at least half of the voxels are set. The node must
  // be one level above the cells.
  uint8_t children(const voxdag_reader::Node& node) const;

 private:
  void set_if_majority(uint64_t offset, uint64_t voxels) {
    if (2 * voxels >= cell_voxels_) bits_[offset / 128] |= uint64_t{1} << offset / 2 % 64;
  }
  bool is_set(uint64_t offset) const;

  const voxdag_reader::File& file_;
  const uint32_t level_;  // the level of the cells
  const uint64_t cell_voxels_;
  PageBuffer<uint64_t> bits_;
};

}  // namespace voxdag::query
