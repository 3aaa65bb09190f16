#include "core/format/color/color_section_writer.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "core/format/bytes.h"
#include "core/format/color/color_layout.h"
#include "core/format/color/wide_sum.h"

namespace voxdag {

using namespace color_layout;

namespace {

constexpr uint32_t kMaxTiers = 3;
static_assert(tier_count(20) == kMaxTiers);
// Of encode_region(), what it is given and its result included.
constexpr uint64_t kEncodeBytesPerCell = 128 + sizeof(ColoredCell);

// A cell of a coarser tier.
struct WideCell {
  uint32_t code = 0;  // Morton code within the region
  WideSum sum;
};

// An array that grows, in pages that are charged to the budget.
template <class T>
class GrowingBuffer {
 public:
  GrowingBuffer(MemoryBudget& budget, const char* what) : budget_(&budget), what_(what) {}
  void append(std::span<const T> values) {
    if (values.empty()) return;
    reserve(size_ + values.size());
    std::memcpy(buffer_.data() + size_, values.data(), values.size_bytes());
    size_ += values.size();
  }
  std::span<const T> values() const { return std::span(buffer_.data(), size_); }
  T& last() { return buffer_[size_ - 1]; }
  bool empty() const { return size_ == 0; }
  void clear() { size_ = 0; }

 private:
  static constexpr size_t kFirstBytes = 4096;
  void reserve(size_t size) {
    if (size <= buffer_.size()) return;
    const size_t larger = std::max(size, 2 * buffer_.size());
    if (buffer_.size() == 0)
      buffer_ = PageBuffer<T>(*budget_, std::max(larger, kFirstBytes / sizeof(T)), what_);
    else
      buffer_.grow(larger, what_);
  }

  MemoryBudget* budget_;
  const char* what_;
  PageBuffer<T> buffer_;
  size_t size_ = 0;
};

// What has been added of a tier.
struct Tier {
  Tier(MemoryBudget& budget, uint32_t finest_level)
      : finest(finest_level),
        directory(budget, "directory of colors"),
        data(budget, "colors of coarse levels"),
        cells(budget, "cells of coarse levels") {}

  const uint32_t finest;
  GrowingBuffer<std::byte> directory;
  GrowingBuffer<std::byte> data;  // of its regions; tier 0 has none here
  GrowingBuffer<WideCell> cells;  // of the open region; tier 0 has none
  uint64_t open_morton = 0;       // of that region
  uint64_t last_morton = 0;       // of the last complete one
  uint64_t regions = 0, units = 0, cell_count = 0, finest_cells = 0;

  uint32_t levels() const { return levels_in_region(finest); }
};

}  // namespace

struct ColorSectionWriter::State {
  GlobalFileWriter& file;
  const uint32_t color_levels;
  MemoryBudget& budget;
  const EncodeCoarse encode_coarse;
  std::vector<Tier> tiers;

  // `total`: of the region's cells. `write` gets the bytes of the region in order.
  template <class Write>
  void add(uint32_t tier_index, const EncodedRegion& region, const WideSum& total, Write write);
  void check(const Tier& tier, const EncodedRegion& region) const;
  void add_cell_above(uint32_t tier_index, uint64_t region_morton, const WideSum& total);
  void close_region(uint32_t tier_index);
};

ColorSectionWriter::ColorSectionWriter(GlobalFileWriter& file, uint32_t color_levels,
                                       MemoryBudget& budget, EncodeCoarse encode_coarse)
    : state_(new State{file, color_levels, budget, std::move(encode_coarse), {}}) {
  state_->tiers.reserve(kMaxTiers);
  for (uint32_t tier = 0; tier < tier_count(color_levels); ++tier)
    state_->tiers.emplace_back(budget, finest_level(color_levels, tier));
  file.begin_section();
}

ColorSectionWriter::~ColorSectionWriter() = default;

void ColorSectionWriter::State::check(const Tier& tier, const EncodedRegion& region) const {
  const auto fail = [&](const std::string& what) {
    throw Error(ErrorCode::kCorrupt, file.path() + ": colors of region " +
                                         std::to_string(region.morton) + " of level " +
                                         std::to_string(tier.finest - tier.levels()) + ": " + what);
  };
  const uint32_t region_bits = 3 * (tier.finest - tier.levels());
  if (region.morton >> region_bits != 0 || (tier.regions > 0 && region.morton <= tier.last_morton))
    fail("it does not follow region " + std::to_string(tier.last_morton));
  uint64_t cells = 0;
  for (uint32_t i = 0; i <= kRegionLevels; ++i) {
    const uint32_t count = region.counts[i];
    const uint64_t most = i <= tier.levels() ? uint64_t{1} << 3 * (tier.levels() - i) : 0;
    if (count > most || (count == 0) != (most == 0))
      fail(std::to_string(count) + " cells on level " + std::to_string(tier.finest - i));
    cells += count;
  }
  const uint64_t bytes = (cells + kBlockCells - 1) / kBlockCells * kBlockBytes;
  if (region.blocks.size() != bytes ||
      region.prefix.size() != prefix_entries(tier.levels(), region.counts))
    fail(std::to_string(region.blocks.size()) + " bytes of blocks, expected " +
         std::to_string(bytes) + "; or another number of prefixes than cells");
}

template <class Write>
void ColorSectionWriter::State::add(uint32_t tier_index, const EncodedRegion& region,
                                    const WideSum& total, Write write) {
  Tier& tier = tiers[tier_index];
  check(tier, region);
  std::vector<std::byte> entry;
  ByteSink sink(entry);
  const auto& counts = region.counts;
  sink.put(region.morton);
  sink.put(tier.units);
  sink.put(counts[0]);
  for (size_t i = 1; i <= 3; ++i) sink.put(static_cast<uint16_t>(counts[i]));
  for (size_t i = 4; i <= kRegionLevels; ++i) sink.put(static_cast<uint8_t>(counts[i]));
  entry.resize(kRegionEntryBytes);
  tier.directory.append(entry);

  const auto prefix = std::as_bytes(std::span(region.prefix));
  const std::byte zeros[kUnitBytes] = {};
  const size_t padding = (kUnitBytes - prefix.size() % kUnitBytes) % kUnitBytes;
  write(region.blocks);
  write(prefix);
  write(std::span(zeros).first(padding));
  tier.units += (region.blocks.size() + prefix.size() + padding) / kUnitBytes;
  for (const uint32_t count : counts) tier.cell_count += count;
  tier.finest_cells += counts[0];
  tier.last_morton = region.morton;
  ++tier.regions;
  if (tier_index + 1 < tiers.size()) add_cell_above(tier_index + 1, region.morton, total);
}

// The parent of a region is a cell of the next tier's finest level.
void ColorSectionWriter::State::add_cell_above(uint32_t tier_index, uint64_t region_morton,
                                               const WideSum& total) {
  Tier& tier = tiers[tier_index];
  const uint64_t cell = region_morton >> 3;
  const uint32_t bits = 3 * tier.levels();
  if (!tier.cells.empty() && cell >> bits != tier.open_morton) close_region(tier_index);
  tier.open_morton = cell >> bits;
  const auto code = static_cast<uint32_t>(cell & ((uint64_t{1} << bits) - 1));
  if (tier.cells.empty() || tier.cells.last().code != code) {
    const WideCell added{code, {}};
    tier.cells.append(std::span(&added, 1));
  }
  tier.cells.last().sum.add(total);
}

void ColorSectionWriter::State::close_region(uint32_t tier_index) {
  Tier& tier = tiers[tier_index];
  EncodedRegion region;
  WideSum total;
  {
    const std::span<const WideCell> wide = tier.cells.values();
    const MemoryCharge charge(budget, wide.size() * kEncodeBytesPerCell, "colors of coarse levels");
    for (const WideCell& cell : wide) total.add(cell.sum);
    const int excess_bits = total.excess_bits();
    std::vector<ColoredCell> cells;
    cells.reserve(wide.size());
    for (const WideCell& cell : wide) cells.push_back({cell.code, cell.sum.narrow(excess_bits)});
    region = encode_coarse ? encode_coarse(tier_index, tier.open_morton, cells)
                           : encode_region(tier.levels(), tier.open_morton, cells);
    tier.cells.clear();
  }
  add(tier_index, region, total,
      [&](std::span<const std::byte> bytes) { tier.data.append(bytes); });
}

void ColorSectionWriter::add_region(const EncodedRegion& region) {
  WideSum total;
  total.add(region.total);
  state_->add(0, region, total,
              [&](std::span<const std::byte> bytes) { state_->file.append(bytes); });
}

void ColorSectionWriter::finish() {
  State& s = *state_;
  if (s.tiers[0].regions == 0)
    throw Error(ErrorCode::kCorrupt, s.file.path() + ": colors without a region");
  for (uint32_t t = 1; t < s.tiers.size(); ++t) s.close_region(t);
  std::vector<std::byte> table;
  ByteSink sink(table);
  GlobalAttribute attribute{global_layout::kColorAttribute, s.color_levels, kBlockBytes, 0,
                            s.tiers[0].finest_cells};
  for (size_t t = 0; t < s.tiers.size(); ++t) {
    const Tier& tier = s.tiers[t];
    sink.put(t == 0 ? uint64_t{0} : s.file.section_bytes());
    sink.put(tier.units);
    sink.put(tier.regions);
    sink.put(tier.cell_count);
    if (t > 0) s.file.append(tier.data.values());
    s.file.append(tier.directory.values());
    attribute.cells += tier.cell_count;
  }
  s.file.append(table);
  s.file.end_section(attribute);
}

}  // namespace voxdag
