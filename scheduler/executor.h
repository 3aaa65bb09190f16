// Builds subvolumes on worker threads: each takes the heaviest one left, builds it with its own
// backend, and appends the artifact to its own segment file. A subvolume that outgrows the worker's
// share of memory is split in eight and comes back as eight.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/backend/backend.h"
#include "core/base/progress.h"
#include "core/format/artifact.h"
#include "scheduler/triangle_bins.h"

namespace voxdag {

// A subvolume task as the executor holds it: what defines it, and where its triangles lie.
struct QueuedSubvolume {
  Cube cube;
  BinId bin = 0;
  double weight = 0;  // heavier ones go first
};

struct ExecutorOptions {
  uint32_t grid_levels = 2;
  uint32_t hash_bits = 64;
  unsigned threads = 1;
  // Subvolumes with longer edges are split before they are tried.
  int64_t longest_edge = INT64_MAX;
  std::function<std::unique_ptr<Backend>()> open_backend;
  std::string segment_folder;
};

struct BuiltSubvolumes {
  std::vector<ArtifactRef> artifacts;  // in no particular order
  uint64_t built = 0;                  // empty ones included
  uint64_t split = 0;
  uint64_t artifact_bytes = 0;
  uint64_t artifact_nodes = 0;
};

// Builds all of `queue`; the bins are dropped as they are used up. Throws the first Error of any
// worker, after all have stopped.
BuiltSubvolumes build_subvolumes(const ExecutorOptions& options, std::vector<QueuedSubvolume> queue,
                                 TriangleBins& bins, FileSystem& files, MemoryBudget& budget,
                                 Progress& progress, const CancelToken& cancel);

}  // namespace voxdag
