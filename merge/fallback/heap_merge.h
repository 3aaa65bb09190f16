// Merges sorted runs row by row, with a heap of one cursor per run. Used for rows that are too many
// to sort in memory, which occurs if hashes are truncated and many rows share few distinct hashes.
// Memory does not depend on the number of rows with equal hashes, because each run is already in
// the total order (merge/load/row.h). Not thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "merge/load/row.h"
#include "merge/output/level_output.h"

namespace voxdag {

// Receives rows in the total order, removes duplicates, and writes the unique rows to a
// LevelOutput.
class OrderedRowWriter {
 public:
  // The first row gets the position (merge/load/row.h) `first_position` in the merged level.
  OrderedRowWriter(LevelOutput& output, const RowFormat& format, uint64_t first_position,
                   MemoryBudget& budget)
      : output_(output),
        format_(format),
        buffer_(budget, format, kBuffered),
        flushed_(first_position) {}

  // Receives a row, which must not be before the previous row in the total order. Returns its
  // position in the merged level.
  uint64_t add(const RowKey& row) {
    if (!any_ || compare_rows(format_, last_, row) != 0) push(row);
    return last_position_;
  }
  // Writes the rows that are still in the buffer.
  void flush();

  uint64_t nodes() const { return nodes_; }
  // Returns the position that the next unique row will get.
  uint64_t end_position() const { return flushed_ + buffered_positions(); }
  static uint64_t bytes() { return MergedRows::bytes_for(kBuffered); }

 private:
  static constexpr RowCount kBuffered{1024, 1024 * kMaxRowWords};

  void push(const RowKey& row);
  uint64_t buffered_positions() const {
    return output_.in_words() ? buffer_.word_count() : buffer_.row_count();
  }

  LevelOutput& output_;
  const RowFormat format_;
  MergedRows buffer_;
  uint64_t flushed_;  // position after the last written row
  uint64_t nodes_ = 0;
  bool any_ = false;
  RowKey last_;
  uint32_t last_words_[kMaxRowWords] = {};
  uint64_t last_position_ = 0;
};

// Calls visit(cursor index, row) for all rows of all cursors in the total order. A Cursor has `bool
// at_end() const`, `RowKey row() const` (valid until advance()) and `void advance()`.
template <class Cursor, class Visit>
void merge_cursors(const RowFormat& format, std::span<Cursor> cursors, Visit&& visit) {
  std::vector<size_t> heap;
  for (size_t i = 0; i < cursors.size(); ++i)
    if (!cursors[i].at_end()) heap.push_back(i);
  const auto later = [&](size_t a, size_t b) {
    return compare_rows(format, cursors[a].row(), cursors[b].row()) > 0;
  };
  std::ranges::make_heap(heap, later);
  while (!heap.empty()) {
    std::ranges::pop_heap(heap, later);
    Cursor& cursor = cursors[heap.back()];
    visit(heap.back(), cursor.row());
    cursor.advance();
    if (cursor.at_end())
      heap.pop_back();
    else
      std::ranges::push_heap(heap, later);
  }
}

}  // namespace voxdag
