// Builds the pyramid of one image, which is the image and its coarser levels, from the image's
// rows. A texel of a coarser level is the mean of the texels that it covers in the next finer
// level. Along an edge of 2n texels, each texel covers two. Along an edge of 2n + 1 texels, texel i
// covers three, with the weights (n - i), n and (i + 1), divided by 2n + 1. So no column or row is
// dropped.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "scene/textures/texture_reader.h"

namespace voxdag {

// Returns the levels of an image of this size, the finest first. `first_page` is the number of the
// first page of the finest level; the pages of the other levels follow.
std::vector<TextureLevel> pyramid_levels(uint32_t width, uint32_t height, uint64_t first_page);

class PyramidBuilder {
 public:
  // A function that writes complete pages (texture_reader.h), starting at page `first`.
  using WritePages = std::function<void(uint64_t first, std::span<const uint64_t> texels)>;

  PyramidBuilder(std::span<const TextureLevel> levels, MemoryBudget& budget, WritePages write);
  // Adds a row of the finest level. Rows are added from the top; all rows must be added.
  void add_row(std::span<const uint64_t> row) { add_row(0, row); }

 private:
  struct Stage {
    PageBuffer<uint64_t> tiles;  // one row of tiles
    PageBuffer<uint64_t> rows;   // the last three rows of the level, for the next level
    uint32_t added = 0;
  };

  void add_row(size_t level, std::span<const uint64_t> row);
  void reduce(size_t level, uint32_t y);

  const std::span<const TextureLevel> levels_;
  std::vector<Stage> stages_;
  PageBuffer<uint64_t> reduced_;
  const WritePages write_;
};

}  // namespace voxdag
