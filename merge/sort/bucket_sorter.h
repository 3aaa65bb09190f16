// Sorts one bucket of a hash partition: brings its rows, from all runs, into the total order and
// deduplicates them. This is the inner loop of the merge.
//
// Unless hashes are truncated, they are spread evenly. So one pass that distributes the rows by the
// hash bits below the bucket's bits leaves almost nothing to sort. Rows with equal hashes are then
// compared completely. Not thread-safe: each thread has its own sorter.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "merge/load/hash_partition.h"
#include "merge/output/merged_rows.h"

namespace voxdag {

class BucketSorter {
 public:
  // Maximum number of rows in a bucket that sort() can sort.
  static constexpr uint64_t kMaxRows = uint64_t{1} << 20;

  // Creates a sorter for buckets of up to `max` rows.
  BucketSorter(MemoryBudget& budget, const RowFormat& format, const RowCount& max);
  static uint64_t bytes_for(const RowCount& max);

  // Sorts a bucket. Positions count words if `in_words` is set, otherwise rows.
  void sort(const HashPartition& partition, size_t bucket, bool in_words);

  // Returns the unique rows of the bucket that was sorted last.
  const MergedRows& unique() const { return unique_; }
  // Returns the position of every row of the bucket, relative to the bucket's first position. The
  // rows are in the order of HashPartition::slices(). A slice has the rows of one run, and their
  // order is kept.
  std::span<const uint32_t> positions() const { return {positions_.data(), row_count_}; }
  // Returns the number of positions that the unique rows take.
  uint64_t extent() const { return extent_; }

 private:
  struct Entry {
    uint64_t hash;
    uint32_t row_and_mask;  // high bits: mask; low bits: the row's index in positions()
    uint32_t word;          // index of the row's first word in the partition

    uint32_t row() const { return row_and_mask & 0xffffff; }
    uint8_t mask() const { return static_cast<uint8_t>(row_and_mask >> 24); }
  };
  static_assert(kMaxRows <= uint64_t{1} << 24);

  void distribute(const HashPartition& partition, size_t bucket);
  void sort_digits(size_t digit_count);
  void emit_unique(bool in_words);
  bool same_row(const Entry& a, const Entry& b) const;

  const RowFormat format_;
  PageBuffer<Entry> entries_;
  PageBuffer<uint32_t> positions_;
  PageBuffer<uint32_t> digit_ends_;
  MergedRows unique_;
  const uint32_t* words_ = nullptr;
  size_t row_count_ = 0;
  uint64_t extent_ = 0;
};

}  // namespace voxdag
