#include "core/format/color/attribute_section_writer.h"

#include <utility>
#include <vector>

#include "core/color/blocks/value_region.h"
#include "core/format/bytes.h"
#include "core/format/color/growing_buffer.h"
#include "core/format/color/section_writer.h"
#include "core/format/color/wide_sum.h"

namespace voxdag {
namespace {

// A region of a coarser tier (attribute_section_writer.h), and its contribution to the value of its
// parent. The parent is the cell of the next coarser tier that contains the region.
template <class Total>
struct CoarseRegion {
  EncodedRegion region;
  Total total;
};

// The rule that computes the colors of coarser tiers. ValueRule is the rule of the other
// attributes. A rule has these members:
//
//   - Total is the contribution of a region to its parent cell. total_of() computes it for a region
//     of tier 0, and encode() for a region of a coarser tier.
//   - Sum collects the Totals of the regions in a cell.
//   - encode() encodes a region of a coarser tier from the Sums of its cells.
class ColorRule {
 public:
  using Sum = WideSum;
  using Total = WideSum;
  // Bytes of memory that encode() needs per cell, including its arguments and its result.
  static constexpr uint64_t kBytesPerCell = 128 + sizeof(ColoredCell);

  explicit ColorRule(AttributeSectionWriter::EncodeColors encode) : encode_(std::move(encode)) {}
  uint32_t block_bytes() const { return kBlockBytes; }
  Total total_of(const EncodedRegion& region) const {
    WideSum total;
    total.add(region.total);
    return total;
  }
  template <class Cells>
  CoarseRegion<Total> encode(uint32_t tier, uint32_t levels, uint64_t morton,
                             const Cells& wide) const {
    WideSum total;
    for (const auto& cell : wide) total.add(cell.sum);
    const int excess_bits = total.excess_bits();
    std::vector<ColoredCell> cells;
    cells.reserve(wide.size());
    for (const auto& cell : wide) cells.push_back({cell.code, cell.sum.narrow(excess_bits)});
    return {encode_ ? encode_(tier, morton, cells) : encode_region(levels, morton, cells), total};
  }

 private:
  const AttributeSectionWriter::EncodeColors encode_;
};

class ValueRule {
 public:
  struct Sum {
    uint32_t count = 0;
    uint32_t values[8] = {};
    void add(uint32_t value) { values[count++] = value; }
  };
  using Total = uint32_t;
  static constexpr uint64_t kBytesPerCell = 10 + sizeof(ValuedCell) + 3 * sizeof(uint32_t) / 2;

  ValueRule(Attribute attribute, uint32_t bytes) : attribute_(attribute), bytes_(bytes) {}
  uint32_t block_bytes() const { return bytes_ * static_cast<uint32_t>(kBlockCells); }
  Total total_of(const EncodedRegion& region) const { return value_of_region(region, bytes_); }
  template <class Cells>
  CoarseRegion<Total> encode(uint32_t, uint32_t levels, uint64_t morton, const Cells& sums) const {
    const auto value_of_parent = traits_of(attribute_).value_of_parent;
    std::vector<ValuedCell> cells;
    cells.reserve(sums.size());
    for (const auto& [code, sum] : sums)
      cells.push_back({code, value_of_parent(std::span(sum.values, sum.count))});
    EncodedRegion region = encode_values(attribute_, bytes_, levels, morton, cells);
    const uint32_t total = total_of(region);
    return {std::move(region), total};
  }

 private:
  const Attribute attribute_;
  const uint32_t bytes_;
};

std::vector<std::byte> padded_list(std::span<const std::string> names) {
  std::vector<std::byte> list;
  ByteSink sink(list);
  sink.put(static_cast<uint32_t>(names.size()));
  for (const std::string& name : names) {
    sink.put(static_cast<uint32_t>(name.size()));
    sink.put_bytes(std::as_bytes(std::span(name)));
  }
  constexpr size_t kUnit = color_layout::kUnitBytes;
  list.resize((list.size() + kUnit - 1) / kUnit * kUnit);
  return list;
}

}  // namespace

class AttributeSectionWriter::Tiers {
 public:
  virtual ~Tiers() = default;
  virtual void add_region(const EncodedRegion& region) = 0;
  virtual void finish() = 0;
};

template <class Rule>
class AttributeSectionWriter::TiersOf : public Tiers {
 public:
  TiersOf(GlobalFileWriter& file, Attribute attribute, uint32_t cell_levels,
          std::span<const std::string> names, MemoryBudget& budget, Rule rule)
      : rule_(std::move(rule)),
        budget_(budget),
        section_(file, attribute, cell_levels, rule_.block_bytes(), budget) {
    if (traits_of(attribute).has_names()) list_ = padded_list(names);
    for (uint32_t tier = 0; tier < section_.tier_count(); ++tier) open_.emplace_back(budget);
  }
  void add_region(const EncodedRegion& region) override { add(0, region, rule_.total_of(region)); }
  void finish() override {
    for (uint32_t tier = 1; tier < section_.tier_count() && section_.region_count(0) > 0; ++tier)
      close_region(tier);
    section_.finish(list_);
  }

 private:
  struct Cell {
    uint32_t code = 0;  // Morton code within the region
    typename Rule::Sum sum;
  };
  // The region of a coarser tier whose cells are being collected. Tier 0 has no such region,
  // because its regions are added complete.
  struct Open {
    explicit Open(MemoryBudget& budget) : cells(budget, "cells of coarse levels") {}
    GrowingBuffer<Cell> cells;
    uint64_t morton = 0;
  };

  void add(uint32_t tier, const EncodedRegion& region, const typename Rule::Total& total) {
    section_.add(tier, region);
    if (tier + 1 < section_.tier_count()) add_to_cell(tier + 1, region.morton >> 3, total);
  }
  // Adds the total of a region to the region's parent. `cell` is the Morton code of the parent, a
  // cell of the finest level of `tier`. If the parent is not in the open region, closes the open
  // region first.
  void add_to_cell(uint32_t tier, uint64_t cell, const typename Rule::Total& total) {
    Open& open = open_[tier];
    const uint32_t bits = 3 * section_.region_levels(tier);
    if (!open.cells.empty() && cell >> bits != open.morton) close_region(tier);
    open.morton = cell >> bits;
    const auto code = static_cast<uint32_t>(cell & ((uint64_t{1} << bits) - 1));
    if (open.cells.empty() || open.cells.last().code != code) {
      const Cell added{code, {}};
      open.cells.append(std::span(&added, 1));
    }
    open.cells.last().sum.add(total);
  }
  void close_region(uint32_t tier) {
    Open& open = open_[tier];
    CoarseRegion<typename Rule::Total> coarse;
    {
      const std::span<const Cell> cells = open.cells.values();
      const MemoryCharge charge(budget_, cells.size() * Rule::kBytesPerCell,
                                "values of coarse levels");
      coarse = rule_.encode(tier, section_.region_levels(tier), open.morton, cells);
      open.cells.clear();
    }
    add(tier, coarse.region, coarse.total);
  }

  const Rule rule_;
  MemoryBudget& budget_;
  std::vector<std::byte> list_;
  SectionWriter section_;
  std::vector<Open> open_;  // by tier
};

AttributeSectionWriter::AttributeSectionWriter(GlobalFileWriter& file, Attribute attribute,
                                               uint32_t cell_levels,
                                               std::span<const std::string> names,
                                               MemoryBudget& budget, EncodeColors encode_coarse) {
  if (traits_of(attribute).is_color())
    tiers_ = std::make_unique<TiersOf<ColorRule>>(file, attribute, cell_levels, names, budget,
                                                  ColorRule(std::move(encode_coarse)));
  else
    tiers_ = std::make_unique<TiersOf<ValueRule>>(
        file, attribute, cell_levels, names, budget,
        ValueRule(attribute, value_bytes(attribute, names.size())));
}

AttributeSectionWriter::~AttributeSectionWriter() = default;

void AttributeSectionWriter::add_region(const EncodedRegion& region) { tiers_->add_region(region); }
void AttributeSectionWriter::finish() { tiers_->finish(); }

}  // namespace voxdag
