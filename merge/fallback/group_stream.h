// A group of equal hashes that is larger than memory (hashes cut to a few bits). It cannot be cut
// by hash, so it is merged row by row: every run's rows of the group are rewired into a scratch
// file, one part of one run at a time, and read back through one small buffer a run.
#pragma once

#include <cstdint>

#include "merge/sort/level_merge.h"

namespace voxdag {

// Merges all rows of hash `hash`; the first unique one goes to `first_position`. `bytes` of the
// budget may be used.
LevelExtent stream_group(const MergeContext& context, const LevelTask& task, uint64_t hash,
                         uint64_t first_position, uint64_t bytes);

}  // namespace voxdag
