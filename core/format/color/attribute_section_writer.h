// Writes the section of an attribute after the levels of a global file. A tier is up to seven
// consecutive levels; tier 0 has the finest levels. A region is a part of a tier with up to 64^3
// cells of the tier's finest level. docs/format.md documents the byte layout in "The color section"
// and "The sections of alpha, normals and materials".
//
// The regions of tier 0 are written when they are added. The cells of the coarser tiers, and the
// directories of all tiers, are in memory until finish(). This memory is charged to the budget. It
// is 32 bytes per region, plus the size of tier 1, which is about a ten-thousandth of the size of
// tier 0. Only one thread may use a writer.
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
  // Encodes the colors of region `morton` in a tier coarser than tier 0. `cells` are its cells of
  // the tier's finest level. The sum of a cell adds up EncodedRegion::total of the next finer
  // tier's regions that are inside the cell.
  using EncodeColors = std::function<EncodedRegion(uint32_t tier, uint64_t morton,
                                                   std::span<const ColoredCell> cells)>;

  // The levels of `file` must be complete and not empty. The set cells of the levels 0 to
  // `cell_levels` have the attribute. `cell_levels` is at least 2, and at most the number of grid
  // levels, which is at most 20. If the values are indices in a list of names, `names` is this
  // list. For colors, if `encode_coarse` is null, the color of a coarser tier's cell is computed
  // from the cell's sum (see EncodeColors).
  AttributeSectionWriter(GlobalFileWriter& file, Attribute attribute, uint32_t cell_levels,
                         std::span<const std::string> names, MemoryBudget& budget,
                         EncodeColors encode_coarse = nullptr);
  ~AttributeSectionWriter();

  // Adds a region of tier 0: a cube of level max(cell_levels - 6, 0). Regions must come in
  // increasing Morton order. Throws Error{kCorrupt} for a region out of order or with inconsistent
  // members. Throws Error{kOutOfMemory} if the budget is too small.
  void add_region(const EncodedRegion& region);
  // Writes the coarser tiers and ends the section. At least one region must have been added.
  void finish();

 private:
  class Tiers;
  template <class Rule>
  class TiersOf;
  std::unique_ptr<Tiers> tiers_;
};

}  // namespace voxdag
