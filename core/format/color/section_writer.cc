#include "core/format/color/section_writer.h"

#include <string>

#include "core/base/error.h"
#include "core/format/bytes.h"

namespace voxdag {

using namespace color_layout;

SectionWriter::SectionWriter(GlobalFileWriter& file, Attribute attribute, uint32_t cell_levels,
                             uint32_t block_bytes, MemoryBudget& budget)
    : file_(file), attribute_(attribute), cell_levels_(cell_levels), block_bytes_(block_bytes) {
  tiers_.reserve(color_layout::tier_count(cell_levels));
  for (uint32_t tier = 0; tier < color_layout::tier_count(cell_levels); ++tier)
    tiers_.emplace_back(budget, finest_level(cell_levels, tier));
  file.begin_section();
}

void SectionWriter::check(const Tier& tier, const EncodedRegion& region) const {
  const auto fail = [&](const std::string& what) {
    throw Error(ErrorCode::kCorrupt,
                file_.path() + ": " + name_of(attribute_) + " of the region of level " +
                    std::to_string(tier.finest - tier.levels()) + " with Morton code " +
                    std::to_string(region.morton) + ": " + what);
  };
  const uint32_t region_bits = 3 * (tier.finest - tier.levels());
  if (region.morton >> region_bits != 0)
    fail("expected a Morton code of " + std::to_string(region_bits) + " bits");
  if (tier.regions > 0 && region.morton <= tier.last_morton)
    fail("expected a Morton code above the previous region's, " + std::to_string(tier.last_morton));
  uint64_t cells = 0;
  for (uint32_t i = 0; i <= kRegionLevels; ++i) {
    const uint32_t count = region.counts[i];
    const uint64_t most = i <= tier.levels() ? uint64_t{1} << 3 * (tier.levels() - i) : 0;
    if (count > most || (count == 0) != (most == 0))
      fail(std::to_string(count) + " cells on level " + std::to_string(tier.finest - i) +
           ", expected " + (most == 0 ? "0" : "1 to " + std::to_string(most)));
    cells += count;
  }
  const uint64_t bytes = (cells + kBlockCells - 1) / kBlockCells * block_bytes_;
  if (region.blocks.size() != bytes ||
      region.prefix.size() != prefix_entries(tier.levels(), region.counts))
    fail(std::to_string(region.blocks.size()) + " bytes of blocks and " +
         std::to_string(region.prefix.size()) + " prefixes, expected " + std::to_string(bytes) +
         " and " + std::to_string(prefix_entries(tier.levels(), region.counts)));
}

void SectionWriter::add(uint32_t tier_index, const EncodedRegion& region) {
  Tier& tier = tiers_[tier_index];
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
  for (const auto bytes :
       {std::span<const std::byte>(region.blocks), prefix, std::span(zeros).first(padding)}) {
    if (tier_index == 0)
      file_.append(bytes);
    else
      tier.data.append(bytes);
  }
  tier.units += (region.blocks.size() + prefix.size() + padding) / kUnitBytes;
  for (const uint32_t count : counts) tier.cell_count += count;
  tier.finest_cells += counts[0];
  tier.last_morton = region.morton;
  ++tier.regions;
}

void SectionWriter::finish(std::span<const std::byte> list) {
  if (tiers_[0].regions == 0)
    throw Error(ErrorCode::kCorrupt, file_.path() + ": the section of " + name_of(attribute_) +
                                         " has no regions: expected at least one");
  std::vector<std::byte> table;
  ByteSink sink(table);
  GlobalAttribute attribute{static_cast<uint32_t>(attribute_), cell_levels_, block_bytes_, 0,
                            tiers_[0].finest_cells};
  for (size_t t = 0; t < tiers_.size(); ++t) {
    const Tier& tier = tiers_[t];
    sink.put(t == 0 ? uint64_t{0} : file_.section_bytes());
    sink.put(tier.units);
    sink.put(tier.regions);
    sink.put(tier.cell_count);
    if (t > 0) file_.append(tier.data.values());
    file_.append(tier.directory.values());
    attribute.cells += tier.cell_count;
  }
  file_.append(list);
  file_.append(table);
  file_.end_section(attribute);
}

}  // namespace voxdag
