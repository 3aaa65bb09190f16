// Builds subvolumes on worker threads. Each worker repeatedly takes the heaviest remaining
// subvolume and builds it with its own backend. The worker appends the artifact to its own segment
// file, and adds the subvolume to its own CommitQueue. If a subvolume needs more memory than the
// worker's share, the worker splits it into octants, which are queued and built separately.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/backend/backend.h"
#include "core/format/artifact/artifact.h"
#include "scheduler/solid/solid_rows.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/state/artifact_cache.h"
#include "scheduler/state/commit_queue.h"
#include "scheduler/state/job_store.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

// A subvolume to build, and the bin of its triangles.
struct QueuedSubvolume {
  StoredSubvolume subvolume;
  BinId bin = 0;
};

struct ExecutorOptions {
  DagShape shape;
  VoxelRule rule = VoxelRule::kShell;
  unsigned threads = 1;
  uint64_t built = 0;  // subvolumes built by earlier runs, for the progress display
  // Maximum edge of a subvolume in voxels. A subvolume with a longer edge is split without an
  // attempt to build it, unless its edge is at most kSmallestEdge.
  int64_t longest_edge = INT64_MAX;
  std::function<std::unique_ptr<Backend>()> open_backend;
  std::string segment_folder;
  uint32_t first_segment_id = 0;
  double checkpoint_interval_s = 2;
  SolidRows* rows = nullptr;       // null if the build is not a solid
  ArtifactCache* cache = nullptr;  // null if builds do not share artifacts
};

struct ExecutorCounts {
  uint64_t split = 0;
  uint64_t cached = 0;  // subvolumes copied from the cache instead of built
};

// Builds `subvolumes` and releases their bins. Records the results in `jobs` in groups
// (CommitQueue). Moves the workers' commit queues to `unfinished`. Unless `triangles` is a
// DurableStore, the last group of each queue is recorded only when the caller calls
// unfinished.commit(). Throws the first Error of any worker after all workers have stopped and
// finished subvolumes are recorded.
ExecutorCounts build_subvolumes(const ExecutorOptions& options,
                                std::vector<QueuedSubvolume> subvolumes, TriangleStore& triangles,
                                JobStore& jobs, CommitQueues& unfinished, MemoryBudget& budget,
                                const BuildContext& context);

}  // namespace voxdag
