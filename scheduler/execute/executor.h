// Builds subvolumes on worker threads: each takes the heaviest one left, builds it with its own
// backend, appends the artifact to its own segment file and journals it. A subvolume that outgrows
// the worker's share of memory is split in eight and comes back as eight.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "core/backend/backend.h"
#include "core/format/artifact/artifact.h"
#include "scheduler/build_spec.h"
#include "scheduler/execute/artifact_cache.h"
#include "scheduler/execute/commit_queue.h"
#include "scheduler/job/job_store.h"
#include "scheduler/triangles/triangle_bins.h"

namespace voxdag {

// A subvolume as the executor holds it: what defines it, and where its triangles lie. Heavier ones
// go first.
struct QueuedSubvolume {
  StoredSubvolume subvolume;
  BinId bin = 0;
  std::optional<BinId>
      kept;  // the kept bin, this one or another, from which it can be filled again
};

struct ExecutorOptions {
  uint32_t grid_levels = 2;
  uint32_t hash_bits = 64;
  unsigned threads = 1;
  // Subvolumes with longer edges are split before they are tried.
  int64_t longest_edge = INT64_MAX;
  std::function<std::unique_ptr<Backend>()> open_backend;
  std::string segment_folder;
  uint32_t first_segment_id = 0;
  double checkpoint_interval_s = 2;
  ArtifactCache* cache = nullptr;  // if artifacts are shared between builds
};

struct ExecutorCounts {
  uint64_t split = 0;
  uint64_t cached = 0;  // copied from the cache instead of built
};

// Builds all of `queue`; the bins are dropped as they are used up. Each result is recorded in
// `store`, but for the last ones, which are announced there and recorded by `open`. Throws the
// first Error of any worker after all have stopped and what was finished is recorded.
ExecutorCounts build_subvolumes(const ExecutorOptions& options, std::vector<QueuedSubvolume> queue,
                                TriangleBins& bins, JobStore& store, CommitQueues& open,
                                MemoryBudget& budget, const BuildContext& context);

}  // namespace voxdag
