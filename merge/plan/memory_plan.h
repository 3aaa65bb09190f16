// How a merge divides the memory that it is given.
//
//   position maps   of the level below and of this one, up to resident_bytes each; else spilled
//   workers         frames, windows of spilled maps, what a range sweep needs
//   slab            all the rest, slab_bytes at least
//
// The fan-in is bounded by the slab: it must hold two frames of every run, so that whatever the
// hashes, the rows of any one hash fit unless they are many.
#pragma once

#include <algorithm>
#include <cstdint>

#include "merge/load/hash_partition.h"

namespace voxdag {

struct MemoryPlan {
  unsigned workers = 1;
  uint64_t worker_bytes = 0;    // each
  uint64_t resident_bytes = 0;  // position maps of one level
  uint64_t slab_bytes = 0;

  static MemoryPlan divide(uint64_t bytes, unsigned threads) {
    constexpr uint64_t kMinWorkerBytes = kFrameMemoryBytes + (uint64_t{128} << 10);
    MemoryPlan plan;
    const uint64_t for_workers = bytes / 4;
    plan.workers = static_cast<unsigned>(
        std::clamp<uint64_t>(for_workers / (uint64_t{1} << 20), 1, std::max(1u, threads)));
    plan.worker_bytes = std::max(for_workers / plan.workers, kMinWorkerBytes);
    plan.resident_bytes = bytes / 6;
    const uint64_t others = plan.workers * plan.worker_bytes + 2 * plan.resident_bytes;
    plan.slab_bytes = slab_within(bytes - std::min(bytes, others));
    return plan;
  }

  // The slab that free memory allows, a little kept back for its table of ranges and the indexes.
  static uint64_t slab_within(uint64_t free_bytes) { return free_bytes - free_bytes / 16; }
};

}  // namespace voxdag
