// The visible texels of an image, one bit per texel, with coarser levels. A block of level k covers
// 2^k x 2^k texels. Each block has a bit that is set if any of its texels is visible, and a bit
// that is set if all of them are visible. Any number of threads may read a finished mask.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"

namespace voxdag {

class AlphaMask {
 public:
  // Creates a mask whose texels are all hidden. Charges the bits to `budget`.
  AlphaMask(uint32_t width, uint32_t height, MemoryBudget& budget);

  uint32_t width() const { return levels_[0].width; }
  uint32_t height() const { return levels_[0].height; }
  void set_visible(uint32_t x, uint32_t y) {
    const size_t bit = x % 64;
    words_[levels_[0].any + size_t{y} * levels_[0].row_words + x / 64] |= uint64_t{1} << bit;
  }
  // Computes the coarser levels. Call it once, after all set_visible().
  void finish();

  // The last level has one block.
  uint32_t levels() const { return static_cast<uint32_t>(levels_.size()); }
  uint32_t width(uint32_t level) const { return levels_[level].width; }
  uint32_t height(uint32_t level) const { return levels_[level].height; }
  bool any_visible(uint32_t level, uint32_t x, uint32_t y) const {
    return bit(levels_[level].any, level, x, y);
  }
  bool all_visible(uint32_t level, uint32_t x, uint32_t y) const {
    return bit(levels_[level].all, level, x, y);
  }
  // The bits of the texels, row by row. Each row begins at a new word.
  std::span<const uint64_t> texels() const {
    return {words_.data(), size_t{levels_[0].row_words} * levels_[0].height};
  }

 private:
  struct Level {
    uint32_t width, height, row_words;
    // Positions in words_ at which the bits of any_visible() and all_visible() begin. For the
    // finest level, both positions are equal.
    size_t any, all;
  };

  bool bit(size_t first, uint32_t level, uint32_t x, uint32_t y) const {
    return words_[first + size_t{y} * levels_[level].row_words + x / 64] >> x % 64 & 1;
  }
  void set(size_t first, const Level& level, uint32_t x, uint32_t y) {
    words_[first + size_t{y} * level.row_words + x / 64] |= uint64_t{1} << x % 64;
  }

  std::vector<Level> levels_;
  PageBuffer<uint64_t> words_;
};

}  // namespace voxdag
