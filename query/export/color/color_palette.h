// Replaces many colors by few, for formats with indexed colors. First all colors are added, then
// the palette is made, and then each color gets an index.
//
// Up to 255 distinct colors are kept unchanged. Otherwise colors with the same six high bits per
// channel are treated as one color, called a bin. The bins, as points in Oklab (Ottosson 2020), are
// divided into 255 boxes, and the mean of each box is a color of the palette. The spread of a box
// is the sum of squared distances from the box's mean along an axis. It is computed for the axis
// where this sum is largest. Each step divides the box with the largest spread at its mean on this
// axis. A division at the median, as in Heckbert's method, makes the picture 0.3 to 0.6 dB worse.
// All arithmetic is in integers, or in IEEE operations in a fixed order. So the palette depends
// only on how often each color occurs.
//
// The used memory does not grow with the number of colors; it is charged to the budget. A palette
// must be used by only one thread.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag::query {

class ColorPalette {
 public:
  static constexpr size_t kMaxColors = 255;

  explicit ColorPalette(MemoryBudget& budget);

  // Adds a color. At most 2^32 colors can be added.
  void add(voxdag_reader::Rgb color);
  // Makes the palette after the last add().
  void make();

  const std::vector<voxdag_reader::Rgb>& colors() const { return colors_; }
  // Returns the index in colors() of an added color.
  uint8_t index_of(voxdag_reader::Rgb color) const;

 private:
  static constexpr size_t kBins = size_t{1} << 18;
  struct Bin {
    uint64_t count = 0;
    std::array<uint64_t, 3> sums{};
  };
  // A bin as a point in Oklab. `bin` is the index of the bin.
  struct Point {
    std::array<uint32_t, 3> lab{};
    uint32_t bin = 0;
  };
  // All sums and counts are over the colors that were added, so a color that was added n times
  // counts n times.
  struct PaletteBox {
    size_t begin = 0, end = 0;    // range of its points in points_
    size_t axis = 0;              // axis of the largest spread
    uint64_t spread = 0;          // sum of squared distances from the mean along this axis
    uint64_t sum = 0, count = 0;  // sum of the coordinates along this axis, number of colors
  };

  static voxdag_reader::Rgb mean_of(const Bin& bin);
  bool add_distinct(uint32_t packed);
  PaletteBox box_of(size_t begin, size_t end) const;
  size_t cut(const PaletteBox& box);
  Bin sum_of(const PaletteBox& box) const;
  void assign_bins();

  MemoryCharge charge_;
  // The distinct colors as 24-bit numbers in increasing order. The list is used only while it has
  // at most kMaxColors colors.
  std::vector<uint32_t> distinct_;
  bool is_exact_ = true;
  std::vector<Bin> bins_;
  std::vector<Point> points_;
  std::vector<uint8_t> index_of_bin_;
  std::vector<voxdag_reader::Rgb> colors_;
};

}  // namespace voxdag::query
