// A subvolume becomes its octants: where it does not fit the memory of a worker, or takes a
// cluster's task too long.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/progress.h"
#include "scheduler/stages/build/executor.h"
#include "scheduler/state/job_store.h"
#include "scheduler/triangles/triangle_store.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// The octants of `whole` that have triangles, recorded in its place, and a bin for each; the bin of
// `whole` is released. The edge of `whole` must be longer than kSmallestEdge.
std::vector<QueuedSubvolume> split_subvolume(const QueuedSubvolume& whole, uint32_t grid_levels,
                                             TriangleStore& triangles, JobStore& jobs,
                                             Progress& progress, const CancelToken& cancel);

}  // namespace voxdag
