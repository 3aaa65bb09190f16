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

// Records, in place of `whole`, its octants that have triangles. Returns these octants with a bin
// for each, and releases the bin of `whole`. The edge of `whole` must be longer than kSmallestEdge.
std::vector<QueuedSubvolume> split_subvolume(const QueuedSubvolume& whole, uint32_t grid_levels,
                                             TriangleStore& triangles, JobStore& jobs,
                                             Progress& progress, const CancelToken& cancel);

}  // namespace voxdag
