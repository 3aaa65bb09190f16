// The step "sweep", its inner loop: the rows of one range of a slab, from all runs, brought into
// the total order, equal ones dropped.
//
// A range's hashes are spread evenly unless they are cut short, so one distribution pass on their
// next bits leaves little to sort. Rows of equal hash are then compared as a whole.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "merge/load/slab.h"

namespace voxdag {

class RangeSweeper {
 public:
  // More rows than this are not swept at once.
  static constexpr uint64_t kMaxRows = uint64_t{1} << 20;

  // For ranges of up to `rows` rows with `words` words.
  RangeSweeper(MemoryBudget& budget, bool bricks, uint64_t rows, uint64_t words);
  static uint64_t bytes_for(uint64_t rows, uint64_t words);

  // Sweeps one range. Positions count the words of records if `in_words`, else rows.
  void sweep(const Slab& slab, size_t range, bool in_words);

  // The unique rows, until the next call.
  const RecordBatch& unique() const { return unique_; }
  // Position, from the range's first, of every row: piece after piece, in each piece's order.
  std::span<const uint32_t> positions() const { return {positions_.data(), row_count_}; }
  // Positions that the unique rows take up.
  uint64_t extent() const { return extent_; }

 private:
  struct Entry {
    uint64_t hash;
    uint32_t row_and_mask;  // the row in the order of positions(), below the mask
    uint32_t word;          // first one, in the slab

    uint32_t row() const { return row_and_mask & 0xffffff; }
    uint8_t mask() const { return static_cast<uint8_t>(row_and_mask >> 24); }
  };
  static_assert(kMaxRows <= uint64_t{1} << 24);

  void distribute(const Slab& slab, size_t range);
  void sort_buckets(size_t bucket_count);
  void emit_groups(bool in_words);
  bool same_row(const Entry& a, const Entry& b) const;

  PageBuffer<Entry> entries_;
  PageBuffer<uint32_t> positions_;
  PageBuffer<uint32_t> bucket_ends_;
  RecordBatch unique_;
  const uint32_t* words_ = nullptr;
  size_t row_count_ = 0;
  uint64_t extent_ = 0;
};

}  // namespace voxdag
