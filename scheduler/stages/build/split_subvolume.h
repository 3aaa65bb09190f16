// Replaces a subvolume by its octants, because it does not fit a worker's memory or a cluster task
// ran out of time.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/progress.h"
#include "scheduler/stages/build/executor.h"
#include "scheduler/state/job_store.h"
#include "scheduler/triangles/triangle_store.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// The rows of a solid, and the memory to compute the rows of a split subvolume's octants.
struct SplitSolid {
  SolidRows& rows;
  MemoryBudget& budget;
};

// Replaces `whole` in the job store by its octants that have triangles. For a solid, octants
// without triangles that are inside the solid also replace it. Returns these octants with a bin for
// each, and releases the bin of `whole`. The edge of `whole` must be longer than kSmallestEdge.
std::vector<QueuedSubvolume> split_subvolume(const QueuedSubvolume& whole, uint32_t grid_levels,
                                             TriangleStore& triangles, JobStore& jobs,
                                             Progress& progress, const CancelToken& cancel,
                                             const SplitSolid* solid = nullptr);

}  // namespace voxdag
