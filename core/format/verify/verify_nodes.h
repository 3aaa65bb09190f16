// Checks the rules 2 to 5 of verify.h: the nodes of all levels, and the numbers of voxels and
// octree nodes in the header. Goes from the bricks to the root. For each level, one pass over its
// nodes checks them and computes their values (subtree_table.h) from the values of their children.
#pragma once

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/global/page_limit.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Throws Error{kCorrupt} if a rule is broken. `is_quick` is explained at verify_global_file().
void verify_nodes(const voxdag_reader::File& file, unsigned threads, MemoryBudget& budget,
                  Progress& progress, const CancelToken& cancel, bool is_quick, PageLimit& pages);

}  // namespace voxdag
