// Writes the section of an attribute after the levels of a global file. docs/format.md, "The color
// section" and "The sections of alpha, normals and materials", documents the byte layout.
//
// The regions of tier 0 are written when they are added. The cells of the coarser tiers and the
// directories are in memory until finish(). They take 32 bytes per region, plus the size of tier 1,
// which is a ten-thousandth of tier 0. This memory is charged to the budget. One thread uses a
// writer.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "core/base/memory_budget.h"
#include "core/color/attributes.h"
#include "core/color/blocks/region.h"
#include "core/format/global/global_writer.h"

namespace voxdag {

class AttributeSectionWriter {
 public:
  // Encodes a region of colors in a tier above tier 0. The sum of each cell is the sum of the
  // totals of the regions in the cell.
  using EncodeColors = std::function<EncodedRegion(uint32_t tier, uint64_t morton,
                                                   std::span<const ColoredCell> cells)>;

  // The levels of `file` must be complete and not empty. The set cells of level `cell_levels` (2 to
  // 20, at most the grid's) and of all coarser levels have the attribute. `names`: the list of
  // names that the values index, if the attribute has such a list. Without `encode_coarse`, coarser
  // cells have the colors of their sums.
  AttributeSectionWriter(GlobalFileWriter& file, Attribute attribute, uint32_t cell_levels,
                         std::span<const std::string> names, MemoryBudget& budget,
                         EncodeColors encode_coarse = nullptr);
  ~AttributeSectionWriter();

  // Adds a region of tier 0: a cube of level max(cell_levels - 6, 0). Regions must come in
  // increasing Morton order. Throws Error{kCorrupt} for a region out of order or with inconsistent
  // parts. Throws Error{kOutOfMemory} if the budget is too small.
  void add_region(const EncodedRegion& region);
  // Writes the other tiers and ends the section. There must be at least one region.
  void finish();

 private:
  class Tiers;
  template <class Rule>
  class TiersOf;
  std::unique_ptr<Tiers> tiers_;
};

}  // namespace voxdag
