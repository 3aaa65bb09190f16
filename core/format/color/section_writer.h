// Writes an attribute section after the levels of a global file: tiers of regions (defined in
// attribute_section_writer.h), and the tiers' directories. All attributes use this class.
// docs/format.md, "The color section", documents the byte layout.
//
// The regions of tier 0 are written to the file when they are added. The regions of the coarser
// tiers and the directories are in memory until finish(), charged to the budget. Only one thread
// may use a writer.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/color/attribute_set.h"
#include "core/color/blocks/region.h"
#include "core/format/color/color_layout.h"
#include "core/format/color/growing_buffer.h"
#include "core/format/global/global_writer.h"

namespace voxdag {

class SectionWriter {
 public:
  // The levels of `file` must be complete and not empty. The set cells of the levels 0 to
  // `cell_levels` have the attribute. `cell_levels` is at least 2, and at most the number of grid
  // levels, which is at most 20. `block_bytes` is the number of bytes for the values of 32 cells.
  SectionWriter(GlobalFileWriter& file, Attribute attribute, uint32_t cell_levels,
                uint32_t block_bytes, MemoryBudget& budget);

  uint32_t tier_count() const { return static_cast<uint32_t>(tiers_.size()); }
  // Returns how many levels the tier's regions are above the tier's finest level.
  uint32_t region_levels(uint32_t tier) const { return tiers_[tier].levels(); }
  uint64_t region_count(uint32_t tier) const { return tiers_[tier].regions; }
  // Adds a region. The regions of a tier must come in increasing Morton order. Throws
  // Error{kCorrupt} for a region out of order or with inconsistent members. Throws
  // Error{kOutOfMemory} if the budget is too small.
  void add(uint32_t tier, const EncodedRegion& region);
  // Writes the coarser tiers, the directories, `list` and the tier table, and ends the section.
  // Tier 0 must have a region. `list` is the list of materials as it is stored, or empty.
  void finish(std::span<const std::byte> list = {});

 private:
  // The data added to a tier so far.
  struct Tier {
    Tier(MemoryBudget& budget, uint32_t finest_level)
        : finest(finest_level),
          directory(budget, "directory of colors"),
          data(budget, "colors of coarse levels") {}

    uint32_t finest;
    GrowingBuffer<std::byte> directory;
    GrowingBuffer<std::byte> data;  // data of the regions; unused in tier 0
    uint64_t last_morton = 0;       // Morton code of the last region
    uint64_t regions = 0, units = 0, cell_count = 0, finest_cells = 0;

    uint32_t levels() const { return color_layout::levels_in_region(finest); }
  };

  void check(const Tier& tier, const EncodedRegion& region) const;

  GlobalFileWriter& file_;
  const Attribute attribute_;
  const uint32_t cell_levels_, block_bytes_;
  std::vector<Tier> tiers_;
};

}  // namespace voxdag
