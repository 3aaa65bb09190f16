// Writes the colors of a scene behind the levels of a global file. docs/format.md, "The color
// section", is the byte layout.
//
// The regions of tier 0 are written as they come. What becomes of their sums (the coarser tiers)
// and the directories stays in memory until finish(): 32 bytes a region, and what tier 1 takes,
// which is a ten-thousandth of tier 0. All of that is charged to the budget. One thread uses a
// writer.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "core/base/memory_budget.h"
#include "core/color/blocks/region.h"
#include "core/format/global/global_writer.h"

namespace voxdag {

class ColorSectionWriter {
 public:
  // Encodes a region of a tier above the first; each cell has the sum of the totals of the regions
  // in it.
  using EncodeCoarse = std::function<EncodedRegion(uint32_t tier, uint64_t morton,
                                                   std::span<const ColoredCell> cells)>;

  // The levels of `file` must be complete, and there must be some. The set cells of level
  // `color_levels` (2 to 20, at most the grid's) have colors, and those of all coarser levels.
  // Without `encode_coarse` these are the colors of their sums.
  ColorSectionWriter(GlobalFileWriter& file, uint32_t color_levels, MemoryBudget& budget,
                     EncodeCoarse encode_coarse = nullptr);
  ~ColorSectionWriter();

  // Of tier 0: cubes of level max(color_levels - 6, 0), in increasing Morton order. Throws
  // Error{kCorrupt} for one that is not in order or does not fit together, Error{kOutOfMemory}.
  void add_region(const EncodedRegion& region);
  // Writes the other tiers and ends the section. There must be at least one region.
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
