// Merges all rows with one hash if these rows do not fit in memory. Only hashes that are truncated
// to a few bits have that many rows. A hash partition cannot divide rows with equal hashes, so they
// are merged row by row. First, the rows of every run are loaded in parts of a few frames and
// written to a scratch file, with their children replaced by positions. Then all runs are read from
// this file, each through a small buffer, and merged.
#pragma once

#include <cstdint>

#include "merge/plan/merge_context.h"

namespace voxdag {

// Merges all rows whose hash is `hash`, and returns the size of the merged rows. The first unique
// row gets the position (merge/load/row.h) `first_position`. Uses at most `bytes` of the budget.
LevelExtent merge_hash_group(const MergeContext& context, const LevelTask& task, uint64_t hash,
                             uint64_t first_position, uint64_t bytes);

}  // namespace voxdag
