#include "core/format/color/value_section_writer.h"

#include "core/format/bytes.h"

namespace voxdag {

// Of encode_values(), its result included.
constexpr uint64_t kEncodeBytesPerValue = 10 + 3 * sizeof(uint32_t) / 2;

ValueSectionWriter::ValueSectionWriter(GlobalFileWriter& file, Attribute attribute,
                                       uint32_t cell_levels, std::span<const std::string> materials,
                                       MemoryBudget& budget)
    : attribute_(attribute),
      bytes_(voxdag::value_bytes(attribute, materials.size())),
      budget_(budget),
      materials_(materials.begin(), materials.end()),
      section_(file, attribute, cell_levels, bytes_ * static_cast<uint32_t>(kBlockCells), budget) {
  for (uint32_t tier = 0; tier < section_.tier_count(); ++tier) open_.emplace_back(budget);
}

// The parent of a region is a cell of the next tier's finest level.
void ValueSectionWriter::add(uint32_t tier, const EncodedRegion& region) {
  section_.add(tier, region);
  if (tier + 1 == section_.tier_count()) return;
  Open& above = open_[tier + 1];
  const uint64_t cell = region.morton >> 3;
  const uint32_t bits = 3 * section_.region_levels(tier + 1);
  if (!above.children.empty() && cell != above.cell) close_cell(tier + 1);
  if (!above.cells.empty() && cell >> bits != above.morton) close_region(tier + 1);
  above.cell = cell;
  above.morton = cell >> bits;
  above.children.push_back(value_of_region(region, bytes_));
}

void ValueSectionWriter::close_cell(uint32_t tier) {
  Open& open = open_[tier];
  const uint32_t bits = 3 * section_.region_levels(tier);
  const ValuedCell cell{static_cast<uint32_t>(open.cell & ((uint64_t{1} << bits) - 1)),
                        value_of_parent(attribute_, open.children)};
  open.cells.append(std::span(&cell, 1));
  open.children.clear();
}

void ValueSectionWriter::close_region(uint32_t tier) {
  Open& open = open_[tier];
  const std::span<const ValuedCell> cells = open.cells.values();
  const MemoryCharge charge(budget_, cells.size() * kEncodeBytesPerValue,
                            "values of coarse levels");
  const EncodedRegion region =
      encode_values(attribute_, bytes_, section_.region_levels(tier), open.morton, cells);
  open.cells.clear();
  add(tier, region);
}

void ValueSectionWriter::finish() {
  for (uint32_t tier = 1; tier < section_.tier_count() && section_.region_count(0) > 0; ++tier) {
    close_cell(tier);
    close_region(tier);
  }
  std::vector<std::byte> list;
  if (attribute_ == Attribute::kMaterial) {
    ByteSink sink(list);
    sink.put(static_cast<uint32_t>(materials_.size()));
    for (const std::string& name : materials_) {
      sink.put(static_cast<uint32_t>(name.size()));
      sink.put_bytes(std::as_bytes(std::span(name)));
    }
    list.resize((list.size() + color_layout::kUnitBytes - 1) / color_layout::kUnitBytes *
                color_layout::kUnitBytes);
  }
  section_.finish(list);
}

}  // namespace voxdag
