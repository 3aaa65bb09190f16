#include "core/format/color/color_section_writer.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/format/color/growing_buffer.h"
#include "core/format/color/section_writer.h"
#include "core/format/color/wide_sum.h"

namespace voxdag {

namespace {

// Of encode_region(), what it is given and its result included.
constexpr uint64_t kEncodeBytesPerCell = 128 + sizeof(ColoredCell);

// A cell of a coarser tier.
struct WideCell {
  uint32_t code = 0;  // Morton code within the region
  WideSum sum;
};

// The open region of a tier; tier 0 has none.
struct OpenColors {
  explicit OpenColors(MemoryBudget& budget) : cells(budget, "cells of coarse levels") {}
  GrowingBuffer<WideCell> cells;
  uint64_t morton = 0;
};

}  // namespace

struct ColorSectionWriter::State {
  SectionWriter section;
  MemoryBudget& budget;
  const EncodeCoarse encode_coarse;
  std::vector<OpenColors> open = {};  // by tier

  // `total`: of the region's cells.
  void add(uint32_t tier, const EncodedRegion& region, const WideSum& total);
  void add_cell_above(uint32_t tier, uint64_t region_morton, const WideSum& total);
  void close_region(uint32_t tier);
};

ColorSectionWriter::ColorSectionWriter(GlobalFileWriter& file, uint32_t color_levels,
                                       MemoryBudget& budget, EncodeCoarse encode_coarse)
    : state_(new State{{file, Attribute::kColor, color_levels, kBlockBytes, budget},
                       budget,
                       std::move(encode_coarse)}) {
  for (uint32_t tier = 0; tier < state_->section.tier_count(); ++tier)
    state_->open.emplace_back(budget);
}

ColorSectionWriter::~ColorSectionWriter() = default;

void ColorSectionWriter::State::add(uint32_t tier, const EncodedRegion& region,
                                    const WideSum& total) {
  section.add(tier, region);
  if (tier + 1 < section.tier_count()) add_cell_above(tier + 1, region.morton, total);
}

// The parent of a region is a cell of the next tier's finest level.
void ColorSectionWriter::State::add_cell_above(uint32_t tier, uint64_t region_morton,
                                               const WideSum& total) {
  OpenColors& colors = open[tier];
  const uint64_t cell = region_morton >> 3;
  const uint32_t bits = 3 * section.region_levels(tier);
  if (!colors.cells.empty() && cell >> bits != colors.morton) close_region(tier);
  colors.morton = cell >> bits;
  const auto code = static_cast<uint32_t>(cell & ((uint64_t{1} << bits) - 1));
  if (colors.cells.empty() || colors.cells.last().code != code) {
    const WideCell added{code, {}};
    colors.cells.append(std::span(&added, 1));
  }
  colors.cells.last().sum.add(total);
}

void ColorSectionWriter::State::close_region(uint32_t tier) {
  OpenColors& colors = open[tier];
  EncodedRegion region;
  WideSum total;
  {
    const std::span<const WideCell> wide = colors.cells.values();
    const MemoryCharge charge(budget, wide.size() * kEncodeBytesPerCell, "colors of coarse levels");
    for (const WideCell& cell : wide) total.add(cell.sum);
    const int excess_bits = total.excess_bits();
    std::vector<ColoredCell> cells;
    cells.reserve(wide.size());
    for (const WideCell& cell : wide) cells.push_back({cell.code, cell.sum.narrow(excess_bits)});
    region = encode_coarse ? encode_coarse(tier, colors.morton, cells)
                           : encode_region(section.region_levels(tier), colors.morton, cells);
    colors.cells.clear();
  }
  add(tier, region, total);
}

void ColorSectionWriter::add_region(const EncodedRegion& region) {
  WideSum total;
  total.add(region.total);
  state_->add(0, region, total);
}

void ColorSectionWriter::finish() {
  State& s = *state_;
  for (uint32_t tier = 1; tier < s.section.tier_count() && s.section.region_count(0) > 0; ++tier)
    s.close_region(tier);
  s.section.finish();
}

}  // namespace voxdag
