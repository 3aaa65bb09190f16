// Hands the triangles of a prepared scene down to the planned subvolumes, which are then ready to
// build.
#pragma once

#include <span>
#include <vector>

#include "scheduler/execute/executor.h"
#include "scheduler/plan/prepare.h"

namespace voxdag {

// What is kept goes on where an earlier run left it: a subvolume takes its triangles from the bin
// of its cube or of the nearest cube around it. `buffer_bytes` may be used for half-filled chunks.
// Throws DamagedTriangles if what is kept is not all that is needed.
std::vector<QueuedSubvolume> partition_triangles(std::span<const StoredSubvolume> planned,
                                                 PreparedScene& scene, IngestCheckpoint& keeper,
                                                 size_t buffer_bytes, const CancelToken& cancel);

}  // namespace voxdag
