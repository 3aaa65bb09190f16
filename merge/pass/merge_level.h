// Merges one level of all runs, one hash partition after another: loads the partition, sorts its
// buckets in parallel, writes the unique rows in order, and stores the position of every row for
// the level above. The code in fallback/ merges buckets and groups of equal hashes that do not fit
// in memory.
#pragma once

#include "merge/plan/merge_context.h"

namespace voxdag {

// Returns the bytes that all workers need together, without the partition and the maps.
uint64_t bytes_for_workers(const MergeMemory& plan);

// Merges the level of `task`, and returns the size of the merged level. Adds the numbers of hash
// partitions, streamed groups and rows (MergeReport) to the merge's report.
LevelExtent merge_level(const MergeContext& context, const LevelTask& task);

}  // namespace voxdag
