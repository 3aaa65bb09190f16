// Compares the colors of two global files of the same grid, in the cells that are set in both
// files. The cells are on the finest level that has colors in both files. The result does not
// depend on the number of threads.
#pragma once

#include <cstdint>

#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Statistics of color differences. The difference of a channel is in sRGB steps, 0 to 255.
struct ColorDiff {
  uint32_t levels = 0;            // level of the compared cells
  uint64_t cells = 0;             // cells that are set in both files
  uint64_t different_cells = 0;   // cells whose colors differ
  uint32_t largest = 0;           // largest difference of a channel
  uint64_t sum = 0, squares = 0;  // sum of the channels' differences, sum of their squares
  // Adds a cell whose colors in the two files are `a` and `b`.
  void add(const voxdag_reader::Rgb& a, const voxdag_reader::Rgb& b);
  // Returns the mean difference of a channel; 0 if no cells were compared.
  double mean() const;
  // Returns the peak signal-to-noise ratio in dB; infinite if nothing differs.
  double psnr() const;
};

// Compares the colors on up to `threads` threads. Throws Error{kInvalidInput} if a file has no
// colors or the grids differ, Error{kCorrupt} for a damaged file. Needs a few MiB of memory.
ColorDiff diff_colors(const voxdag_reader::File& a, const voxdag_reader::File& b, unsigned threads,
                      const CancelToken& cancel);

}  // namespace voxdag
