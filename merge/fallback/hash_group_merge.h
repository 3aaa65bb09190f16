// Merges all rows with one hash if they do not fit in memory. This happens if hashes are truncated
// to a few bits. Rows with equal hashes cannot be divided by hash, so they are merged row by row.
// First the rows of every run are rewired, part by part, and written to a scratch file. Then they
// are read back through one small buffer per run.
#pragma once

#include <cstdint>

#include "merge/plan/merge_context.h"

namespace voxdag {

// Merges all rows whose hash is `hash`. The first unique row gets the position `first_position`.
// Uses at most `bytes` of the budget.
LevelExtent merge_hash_group(const MergeContext& context, const LevelTask& task, uint64_t hash,
                             uint64_t first_position, uint64_t bytes);

}  // namespace voxdag
