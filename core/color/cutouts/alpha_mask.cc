#include "core/color/cutouts/alpha_mask.h"

#include <algorithm>

namespace voxdag {

AlphaMask::AlphaMask(uint32_t width, uint32_t height, MemoryBudget& budget) {
  size_t words = 0;
  for (;;) {
    const uint32_t row_words = (width + 63) / 64;
    const size_t bits = size_t{row_words} * height;
    // A texel of the finest level needs one bit, and a block of a coarser level needs two.
    const bool is_finest = levels_.empty();
    levels_.push_back({width, height, row_words, words, is_finest ? words : words + bits});
    words += is_finest ? bits : 2 * bits;
    if (width == 1 && height == 1) break;
    width = (width + 1) / 2;
    height = (height + 1) / 2;
  }
  words_ = PageBuffer<uint64_t>(budget, words, "the visible texels of an image");
}

void AlphaMask::finish() {
  for (uint32_t level = 1; level < levels(); ++level) {
    const Level& fine = levels_[level - 1];
    const Level& coarse = levels_[level];
    for (uint32_t y = 0; y < coarse.height; ++y)
      for (uint32_t x = 0; x < coarse.width; ++x) {
        bool any = false, all = true;
        for (uint32_t j = 2 * y; j < std::min(2 * y + 2, fine.height); ++j)
          for (uint32_t i = 2 * x; i < std::min(2 * x + 2, fine.width); ++i) {
            any |= any_visible(level - 1, i, j);
            all &= all_visible(level - 1, i, j);
          }
        if (any) set(coarse.any, coarse, x, y);
        if (all) set(coarse.all, coarse, x, y);
      }
  }
}

}  // namespace voxdag
