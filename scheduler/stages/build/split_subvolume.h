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

// Records, in place of `whole`, its octants that have triangles. Returns these octants with a bin
// for each, and releases the bin of `whole`. Octants of a solid without triangles are kept if they
// are inside. The edge of `whole` must be longer than kSmallestEdge.
std::vector<QueuedSubvolume> split_subvolume(const QueuedSubvolume& whole, uint32_t grid_levels,
                                             TriangleStore& triangles, JobStore& jobs,
                                             Progress& progress, const CancelToken& cancel,
                                             const SplitSolid* solid = nullptr);

}  // namespace voxdag
