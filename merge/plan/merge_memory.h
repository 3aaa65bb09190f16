// How a merge divides the memory that it may use. scheduler/spec/memory_plan.h describes the other
// stages.
//
//   position maps    of the level below and of this level, up to resident_bytes each; larger maps
//                    are spilled
//   workers          frames, windows of spilled maps, memory for sorting a bucket
//   hash partition   all remaining memory, at least partition_bytes
//
// The hash partition limits the number of runs that one pass merges, because it must hold two
// frames of every run. So all rows with the same hash fit in one partition, unless a run has more
// than two frames with rows of this hash.
#pragma once

#include <algorithm>
#include <cstdint>

#include "merge/load/hash_partition.h"

namespace voxdag {

struct MergeMemory {
  unsigned workers = 1;
  uint64_t worker_bytes = 0;    // per worker
  uint64_t resident_bytes = 0;  // limit for one level's position maps in memory
  uint64_t partition_bytes = 0;

  static MergeMemory divide(uint64_t bytes, unsigned threads) {
    constexpr uint64_t kMinWorkerBytes = kFrameMemoryBytes + (uint64_t{128} << 10);
    MergeMemory plan;
    const uint64_t for_workers = bytes / 4;
    plan.workers = static_cast<unsigned>(
        std::clamp<uint64_t>(for_workers / (uint64_t{1} << 20), 1, std::max(1u, threads)));
    plan.worker_bytes = std::max(for_workers / plan.workers, kMinWorkerBytes);
    plan.resident_bytes = bytes / 6;
    const uint64_t others = plan.workers * plan.worker_bytes + 2 * plan.resident_bytes;
    plan.partition_bytes = partition_bytes_within(bytes - std::min(bytes, others));
    return plan;
  }

  // Returns the hash partition's part of the free memory. The rest is for the partition's table of
  // bucket begins (HashPartition::bucket_begin()) and for the artifacts' indexes.
  static uint64_t partition_bytes_within(uint64_t free_bytes) {
    return free_bytes - free_bytes / 16;
  }
};

}  // namespace voxdag
