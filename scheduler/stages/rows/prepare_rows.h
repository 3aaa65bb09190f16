// The rows stage (rows_stage.h) as a part of a build.
#pragma once

#include <span>

#include "scheduler/state/job/build_job.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

// Computes the rows of a solid before its first subvolume is built. Does nothing if the build needs
// no rows, or if an earlier run saved them. The triangles of planned[i] are in bins[i]. Throws
// Error{kCorrupt} if the rows are missing although subvolumes were built.
void prepare_rows(BuildJob& job, std::span<const StoredSubvolume> planned,
                  std::span<const BinId> bins, const TriangleStore& triangles);

}  // namespace voxdag
