// Writes the levels of a global file in a chosen order of the nodes (docs/format.md, "Node order"):
//
//   first_parent.h   the order by first parent, from the root down
//   by_hash.h        the total order by hash, from the bricks up
#pragma once

#include <cstdint>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/voxdag_reader.h"
#include "merge/load/scratch_file.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// The memory for order_levels(), and the folder for data that does not fit in memory.
struct OrderSpace {
  ScratchFolder& folder;
  MemoryBudget& budget;
  uint64_t memory_bytes = 0;  // limit for the resident memory of the process
  // Additional limit for the memory of each list and of each level. Tests use a small limit.
  uint64_t list_bytes = ~uint64_t{0};
};

// Writes the levels of `file` in the given order to `out`, a new file with the same grid. The nodes
// of `file` may be in any order that this program knows.
//
// Throws Error{kUnsupportedVersion} if `file` has an unknown order, or if the pointers to a level
// have 32 bits in `file` but would have 64 bits in `out`, or the reverse. Throws Error{kCorrupt} if
// `file` is damaged. Also throws the errors of writing to and reading from `space.folder`.
void order_levels(const voxdag_reader::File& file, NodeOrder order, const OrderSpace& space,
                  GlobalFileWriter& out, Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
