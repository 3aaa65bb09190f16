// A row as the merge holds it: hash, mask and words. A node's words are its children. A brick is
// held as a node of mask 3 whose two words are the high and the low half of its voxel mask, so that
// one order, (hash, mask, words lexicographically), is the total order of both.
//
// A record is a row as it stands in the global file: a node's mask followed by its children, a
// brick's low half followed by its high half.
//
// Wherever a row's words lie, kLongestRowWords words can be read from the first one on, so that a
// row is copied without asking how many it has: that would be a branch as good as random.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/base/popcount8.h"
#include "core/dag/level_array.h"

namespace voxdag {

inline constexpr uint8_t kBrickRowMask = 3;
inline constexpr uint32_t kBrickWords = 2;
inline constexpr uint32_t kLongestRowWords = 8;

// Words of a row by its mask.
inline constexpr auto& kRowWords = kPopcount8;

struct RowKey {
  uint64_t hash = 0;
  uint8_t mask = 0;
  const uint32_t* words = nullptr;
};

inline int compare_rows(const RowKey& a, const RowKey& b) {
  return compare_nodes(a.hash, a.mask, a.words, b.hash, b.mask, b.words);
}

// Unique rows in order, as records, with their hashes beside them.
class RecordBatch {
 public:
  // Room for `rows` rows of `row_words` words in all.
  RecordBatch(MemoryBudget& budget, bool bricks, uint64_t rows, uint64_t row_words)
      : bricks_(bricks),
        words_(budget, row_words + (bricks ? 0 : rows) + kLongestRowWords, "the merge's output"),
        hashes_(budget, rows, "the merge's output") {}
  static uint64_t bytes_for(uint64_t rows, uint64_t row_words) { return 12 * rows + 4 * row_words; }

  void clear() { word_count_ = row_count_ = 0; }
  // The row must fit.
  void push(uint64_t hash, uint8_t mask, const uint32_t* row_words) {
    hashes_[row_count_++] = hash;
    uint32_t* out = words_.data() + word_count_;
    if (bricks_) {
      out[0] = row_words[1];
      out[1] = row_words[0];
      word_count_ += kBrickWords;
      return;
    }
    out[0] = mask;
    std::memcpy(out + 1, row_words, kLongestRowWords * sizeof(uint32_t));
    word_count_ += 1 + kRowWords[mask];
  }

  bool bricks() const { return bricks_; }
  uint64_t row_count() const { return row_count_; }
  uint64_t word_count() const { return word_count_; }
  uint64_t row_room() const { return hashes_.size() - row_count_; }
  std::span<const uint32_t> words() const { return {words_.data(), word_count_}; }
  std::span<const uint64_t> hashes() const { return {hashes_.data(), row_count_}; }

 private:
  bool bricks_;
  PageBuffer<uint32_t> words_;
  PageBuffer<uint64_t> hashes_;
  uint64_t word_count_ = 0;
  uint64_t row_count_ = 0;
};

}  // namespace voxdag
