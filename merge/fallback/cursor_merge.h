// Row-by-row merging for what the range sweep does not take: many rows of few different hashes
// (hashes cut short). Each run is in the total order already, so a heap over one cursor a run is
// all it takes, whatever the number of equal hashes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "merge/output/level_output.h"
#include "merge/sort/record.h"
#include "merge/sort/sequencer.h"

namespace voxdag {

// Takes rows in the total order, drops equal ones, writes the others.
class OrderedRows {
 public:
  // The first row goes to `first_position`.
  OrderedRows(LevelOutput& output, bool bricks, uint64_t first_position, MemoryBudget& budget)
      : output_(output),
        batch_(budget, bricks, kBatchRows, uint64_t{kBatchRows} * 8),
        flushed_(first_position) {}

  // Where the row stands in the merged level.
  uint64_t add(const RowKey& row) {
    if (!any_ || compare_rows(last_, row) != 0) push(row);
    return last_position_;
  }
  // Writes what was held back.
  void flush();

  uint64_t nodes() const { return nodes_; }
  // Where the next row would go.
  uint64_t end_position() const { return flushed_ + batch_extent(); }
  static uint64_t bytes() { return RecordBatch::bytes_for(kBatchRows, uint64_t{kBatchRows} * 8); }

 private:
  static constexpr uint32_t kBatchRows = 1024;

  void push(const RowKey& row);
  uint64_t batch_extent() const {
    return output_.in_words() ? batch_.word_count() : batch_.row_count();
  }

  LevelOutput& output_;
  RecordBatch batch_;
  uint64_t flushed_;  // position after all rows written
  uint64_t nodes_ = 0;
  bool any_ = false;
  RowKey last_;
  uint32_t last_words_[8] = {};
  uint64_t last_position_ = 0;
};

// A Cursor has  bool at_end() const,  RowKey row() const  (valid until it moves)  and
// void advance().  Calls visit(cursor index, row) for all rows of all cursors in the total order.
template <class Cursor, class Visit>
void merge_cursors(std::span<Cursor> cursors, Visit&& visit) {
  std::vector<size_t> heap;
  for (size_t i = 0; i < cursors.size(); ++i)
    if (!cursors[i].at_end()) heap.push_back(i);
  const auto later = [&](size_t a, size_t b) {
    return compare_rows(cursors[a].row(), cursors[b].row()) > 0;
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
