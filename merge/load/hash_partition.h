// A hash partition: the rows of all runs of one level whose hashes are in an interval. The rows are
// in memory, and their children are replaced by positions (merge/load/row.h defines these terms).
//
//   columns:   [slice of run 0] [slice of run 1] ...
//   buckets:   the interval, divided into shares of 2^bucket_bits hashes
//
// A slice is the part of a run that is in the partition. It consists of complete frames, so a few
// rows at its ends can be outside the interval.
//
// Within a slice rows are in the order of their hashes, so each bucket is a contiguous part of
// every slice: from bucket_begin(b, slice) to bucket_begin(b + 1, slice).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "merge/load/level_run.h"
#include "merge/load/position_maps.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// The frames of one run that belong to a partition, and the start of their rows in the partition's
// columns.
struct RunSlice {
  size_t run = 0;
  FrameSpan frames;
  uint64_t first_row = 0;  // index of the first row in the run
  RowCount size{};
  uint64_t row_base = 0, word_base = 0;  // indices of the first row and word in the columns
};

// The offset of a row in a slice: the number of rows before it, and the number of their words.
struct RowOffset {
  uint32_t row = 0;
  uint32_t word = 0;
};

// The memory of a partition's columns. Each partition reuses the memory of the previous one. In new
// memory, the operating system would have to zero every page, which takes as long as filling the
// page with rows.
class PartitionMemory {
 public:
  // Makes space for `count` rows, each with `position_words` words for its position. The previous
  // contents of the columns are lost.
  void reserve(const RowCount& count, uint32_t position_words, MemoryBudget& budget);
  void release() { *this = {}; }
  uint64_t bytes() const;

 private:
  friend class HashPartition;
  PageBuffer<uint64_t> hashes_;
  PageBuffer<uint8_t> masks_;
  PageBuffer<uint32_t> words_;
  PageBuffer<uint32_t> positions_;
};

// The threads that load a partition, and the additional memory that each may use.
struct PartitionWorkers {
  unsigned count = 1;
  uint64_t bytes_each = 0;
};

// An upper bound of the memory of a Frame with kFrameRows rows.
inline constexpr uint64_t kFrameMemoryBytes = uint64_t{640} << 10;
// Maximum size of a partition in bytes, chosen so that the number of its words fits in 32 bits.
inline constexpr uint64_t kMaxPartitionBytes = uint64_t{8} << 30;

class HashPartition {
 public:
  // Returns the memory of a partition, including `position_words` words (0 to 2) for the position
  // of each row.
  static uint64_t bytes_for(const RowCount& count, uint32_t position_words);
  // Returns the widest interval that begins with hash `first` and whose partition takes at most
  // `bytes`; nullopt if not even the rows of this one hash fit.
  static std::optional<HashInterval> widest_interval(std::span<const LevelRun* const> runs,
                                                     uint64_t first, uint64_t bytes,
                                                     uint32_t position_words);
  // Returns one slice for each run that has frames within the interval, with `run` and `frames`
  // set. The constructor of HashPartition sets the other members of the slices.
  static std::vector<RunSlice> slices_within(std::span<const LevelRun* const> runs,
                                             const HashInterval& interval);

  // Creates a partition for the rows of `slices`. load() reads these rows. Buckets get about
  // `bucket_rows` rows if hashes are spread evenly. Two partitions must not use the same `memory`
  // at the same time.
  HashPartition(std::span<const LevelRun* const> runs, std::vector<RunSlice> slices,
                const HashInterval& interval, uint64_t bucket_rows, uint32_t position_words,
                PartitionMemory& memory, MemoryBudget& budget);

  // Reads the rows and replaces their children by positions from `child_maps`, the position maps of
  // the level below. `child_maps` may be null if the rows are bricks or all runs are already
  // rewired.
  void load(const PositionMaps* child_maps, const PartitionWorkers& workers, MemoryBudget& budget,
            const CancelToken& cancel);

  // Returns the row format. It is the same for all runs.
  const RowFormat& format() const { return runs_[0]->format(); }
  std::span<const RunSlice> slices() const { return slices_; }
  size_t bucket_count() const { return bucket_count_; }
  unsigned bucket_bits() const { return bucket_bits_; }
  // Returns the offset at which a bucket begins in a slice. For `bucket` = bucket_count(), this is
  // the end of the last bucket.
  RowOffset bucket_begin(size_t bucket, size_t slice) const {
    return bucket_begins_[bucket * slices_.size() + slice];
  }
  const uint64_t* hashes() const { return memory_.hashes_.data(); }
  const uint8_t* masks() const { return memory_.masks_.data(); }
  const uint32_t* words() const { return memory_.words_.data(); }
  uint32_t* positions() { return memory_.positions_.data(); }

 private:
  class Loader;

  // Returns the first hash of the bucket with index `bucket`, which is less than bucket_count().
  uint64_t first_hash(size_t bucket) const {
    return bucket == 0 ? interval_.first
                       : ((interval_.first >> bucket_bits_) + bucket) << bucket_bits_;
  }

  std::span<const LevelRun* const> runs_;
  std::vector<RunSlice> slices_;
  HashInterval interval_;
  unsigned bucket_bits_ = 0;
  size_t bucket_count_ = 0;
  PartitionMemory& memory_;
  PageBuffer<RowOffset> bucket_begins_;
};

}  // namespace voxdag
