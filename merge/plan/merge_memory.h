// How a merge divides the memory that it may use. scheduler/spec/memory_plan.h describes the other
// stages.
//
//   position maps    of the level below and of this level, up to resident_bytes each; larger maps
//                    are spilled
//   workers          frames, windows of spilled maps, memory for sorting a bucket
//   hash partition   all remaining memory, at least partition_bytes, but not more than is useful
//                    (LevelRows)
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
  uint64_t useful_partition_bytes = 0;  // as in MergeInputs

  static MergeMemory divide(uint64_t bytes, unsigned threads, uint64_t useful_partition_bytes) {
    constexpr uint64_t kMinWorkerBytes = kFrameMemoryBytes + (uint64_t{128} << 10);
    MergeMemory plan;
    const uint64_t for_workers = bytes / 4;
    plan.workers = static_cast<unsigned>(
        std::clamp<uint64_t>(for_workers / (uint64_t{1} << 20), 1, std::max(1u, threads)));
    plan.worker_bytes = std::max(for_workers / plan.workers, kMinWorkerBytes);
    plan.resident_bytes = bytes / 6;
    const uint64_t others = plan.workers * plan.worker_bytes + 2 * plan.resident_bytes;
    plan.partition_bytes = partition_bytes_within(bytes - std::min(bytes, others));
    plan.useful_partition_bytes = useful_partition_bytes;
    return plan;
  }

  // Returns the hash partition's part of the free memory. The rest is for the partition's table of
  // bucket begins (HashPartition::bucket_begin()) and for the artifacts' indexes.
  static uint64_t partition_bytes_within(uint64_t free_bytes) {
    return free_bytes - free_bytes / 16;
  }
};

// The rows of all runs of one level, and the useful size of the level's hash partitions.
class LevelRows {
 public:
  // Adds a run.
  void add(const RowCount& run) {
    if (run.rows == 0) return;
    total_.add(run);
    frames_ += (run.rows + kFrameRows - 1) / kFrameRows;
    ++runs_;
  }
  const RowCount& total() const { return total_; }

  // Returns the size up to which more memory for a partition makes the merge faster.
  // `position_words`: as for HashPartition::bytes_for().
  uint64_t useful_bytes(const MergeMemory& plan, uint32_t position_words) const {
    if (runs_ == 0) return plan.useful_partition_bytes;
    const uint64_t bytes = HashPartition::bytes_for(total_, position_words);
    // Where two partitions meet, a frame of each run is decoded for both. With this number of
    // partitions, at most a quarter of the frames are decoded twice.
    const uint64_t max_partitions = 1 + frames_ / (4 * runs_);
    const uint64_t shared_bytes = (bytes / frames_ + 1) * runs_;
    return std::max(plan.useful_partition_bytes, bytes / max_partitions + shared_bytes);
  }
  // Returns the expected size of a partition of useful_bytes() without positions. Adds 1/32,
  // because the numbers of rows and words vary from partition to partition.
  RowCount useful_rows(const MergeMemory& plan) const {
    const double bytes = static_cast<double>(HashPartition::bytes_for(total_, 0));
    const double share =
        33.0 / 32 * static_cast<double>(useful_bytes(plan, 0)) / std::max(bytes, 1.0);
    if (share >= 1) return total_;
    return {static_cast<uint64_t>(share * static_cast<double>(total_.rows)),
            static_cast<uint64_t>(share * static_cast<double>(total_.words))};
  }

 private:
  RowCount total_;
  uint64_t frames_ = 0;
  uint64_t runs_ = 0;  // runs with rows
};

}  // namespace voxdag
