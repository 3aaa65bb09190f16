// Merges one level of all runs, one hash partition after the other: loads the partition, sorts its
// buckets in parallel, writes the unique rows in order, and stores the position of every row for
// the level above. Buckets and groups of equal hashes that are too large for that go to fallback/.
#pragma once

#include "merge/plan/merge_context.h"

namespace voxdag {

// Memory for the workers, in addition to the partition and the maps.
uint64_t bytes_for_workers(const MergeMemory& plan);

// Adds partitions, groups and rows to the report.
LevelExtent merge_level(const MergeContext& context, const LevelTask& task);

}  // namespace voxdag
