// Unique rows of a level in the total order, with their hashes, for the output.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "merge/load/row.h"

namespace voxdag {

// A list of rows, encoded as in the global file. A node is its mask followed by its children. A
// brick and a wide child take two words each: the low half, then the high half.
class MergedRows {
 public:
  // Creates a list with space for up to `max` rows.
  MergedRows(MemoryBudget& budget, const RowFormat& format, const RowCount& max)
      : format_(format),
        words_(budget, max.words + (format.bricks ? 0 : max.rows) + kMaxRowWords,
               "the merge's output"),
        hashes_(budget, max.rows, "the merge's output") {}
  static uint64_t bytes_for(const RowCount& max) { return 12 * max.rows + 4 * max.words; }

  void clear() { word_count_ = row_count_ = 0; }
  // Appends a row. The list must have fewer rows and words than the constructor's `max`.
  void push(uint64_t hash, uint8_t mask, const uint32_t* row_words) {
    hashes_[row_count_++] = hash;
    uint32_t* out = words_.data() + word_count_;
    if (format_.bricks) {
      out[0] = row_words[1];
      out[1] = row_words[0];
      word_count_ += kBrickWords;
      return;
    }
    *out++ = mask;
    word_count_ += 1 + format_.words(mask);
    if (!format_.wide) {
      std::memcpy(out, row_words, kMaxRowWords / 2 * sizeof(uint32_t));
      return;
    }
    for (uint32_t i = 0; i < format_.words(mask); i += 2) {
      out[i] = row_words[i + 1];
      out[i + 1] = row_words[i];
    }
  }

  bool bricks() const { return format_.bricks; }
  bool full() const { return row_count_ == hashes_.size(); }
  uint64_t row_count() const { return row_count_; }
  uint64_t word_count() const { return word_count_; }
  std::span<const uint32_t> words() const { return {words_.data(), word_count_}; }
  std::span<const uint64_t> hashes() const { return {hashes_.data(), row_count_}; }

 private:
  RowFormat format_;
  PageBuffer<uint32_t> words_;
  PageBuffer<uint64_t> hashes_;
  uint64_t word_count_ = 0;
  uint64_t row_count_ = 0;
};

}  // namespace voxdag
