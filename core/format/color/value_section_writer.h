// Writes the section of an attribute other than color behind the levels of a global file; see
// docs/format.md, "The sections of alpha, normals and materials".
//
// What is written when, and what stays in memory, is as ColorSectionWriter has it. One thread uses
// a writer.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/color/blocks/value_region.h"
#include "core/format/color/section_writer.h"

namespace voxdag {

class ValueSectionWriter {
 public:
  // As SectionWriter. `materials`: the list of their names, for that attribute alone.
  ValueSectionWriter(GlobalFileWriter& file, Attribute attribute, uint32_t cell_levels,
                     std::span<const std::string> materials, MemoryBudget& budget);

  // The bytes of a value.
  uint32_t value_bytes() const { return bytes_; }
  // A region of tier 0, as SectionWriter::add().
  void add_region(const EncodedRegion& region) { add(0, region); }
  // Writes the other tiers and ends the section. There must be at least one region.
  void finish();

 private:
  // Cells of the finest level of the tier's open region, and the children of the next one.
  struct Open {
    explicit Open(MemoryBudget& budget) : cells(budget, "cells of coarse levels") {}
    GrowingBuffer<ValuedCell> cells;
    uint64_t morton = 0;
    uint64_t cell = 0;  // Morton code in the grid
    std::vector<uint32_t> children;
  };

  void add(uint32_t tier, const EncodedRegion& region);
  void close_cell(uint32_t tier);
  void close_region(uint32_t tier);

  const Attribute attribute_;
  const uint32_t bytes_;
  MemoryBudget& budget_;
  const std::vector<std::string> materials_;
  SectionWriter section_;
  std::vector<Open> open_;  // by tier; tier 0 has none
};

}  // namespace voxdag
