#include "query/attributes/stored_section.h"

#include <algorithm>
#include <iterator>
#include <vector>

#include "core/color/cell_values.h"
#include "core/color/color_of.h"
#include "core/format/color/color_layout.h"
#include "core/format/global/open_global.h"

namespace voxdag::query {

using voxdag_reader::ColorRegion;
using voxdag_reader::ColorSection;
using voxdag_reader::ColorTier;

ColorSum sum_of(const voxdag_reader::Rgb& rgb, uint64_t n) {
  ColorSum sum;
  const uint8_t channels[3] = {rgb.r, rgb.g, rgb.b};
  for (size_t c = 0; c < 3; ++c) sum.plain[c] = n * color::intensity_of(channels[c]);
  sum.seen = sum.plain;
  sum.weight = sum.seen_weight = n;
  return sum;
}

StoredSection::StoredSection(const voxdag_reader::File& file, Attribute attribute,
                             FileSystem& files, MemoryBudget& budget)
    : file_(file),
      traits_(traits_of(attribute)),
      section_(section_of(file, attribute)),
      source_(files, file, budget) {}

void StoredSection::check_index(uint32_t finest, const CancelToken& cancel) {
  constexpr uint64_t kBlockBytes = CheckedReader::kBlockBytes;
  std::vector<std::byte> block(kBlockBytes);
  const auto check = [&](uint64_t begin, uint64_t bytes) {
    for (uint64_t done = 0; done < bytes; done += kBlockBytes) {
      cancel.check();
      source_.check(begin + done, std::min(kBlockBytes, bytes - done), block);
    }
  };
  for (uint32_t l = 0; l <= std::min(finest, file_.brick_level()); ++l) {
    const voxdag_reader::Level& level = file_.level(l);
    check(level.file_offset, level.word_count * sizeof(uint32_t));
  }
  for (uint32_t t = 0; t < section_.tier_count(); ++t) {
    const ColorTier& tier = section_.tier(t);
    check(offset_of(tier.directory), tier.region_count * color_layout::kRegionEntryBytes);
  }
  // The list of names follows the last directory.
  const ColorTier& last = section_.tier(section_.tier_count() - 1);
  if (traits_.has_names())
    check(offset_of(last.directory) + last.region_count * color_layout::kRegionEntryBytes,
          list_bytes(section_.names()));
}

void StoredSection::check_values(uint32_t finest, uint32_t level, uint64_t code) {
  std::vector<std::byte> block(CheckedReader::kBlockBytes);
  for (uint32_t t = 0; t < section_.tier_count(); ++t) {
    const ColorTier& tier = section_.tier(t);
    const bool is_coarser = t > 0 && tier.finest_level < level;
    if (is_coarser || tier.region_level > finest) continue;
    // The values of the cube are in the regions with Morton codes from `begin` to end - 1.
    const bool within = tier.region_level < level;
    const uint32_t between = within ? level - tier.region_level : tier.region_level - level;
    const uint64_t begin = within ? code >> 3 * between : code << 3 * between;
    const uint64_t end = within ? begin + 1 : (code + 1) << 3 * between;
    for (uint64_t i = ColorSection::lower_bound(tier, begin); i < tier.region_count; ++i) {
      ColorRegion region;
      if (!ColorSection::region(tier, i, region))
        file_.broken_section(section_,
                             "entry " + std::to_string(i) + " of the directory of level " +
                                 std::to_string(tier.region_level) +
                                 " is damaged, expected counts and an offset within the section");
      if (region.morton >= end) break;
      source_.check(offset_of(region.blocks), region.units() * color_layout::kUnitBytes, block);
    }
  }
}

EncodedRegion StoredSection::copy_region(const ColorTier& tier, uint64_t code,
                                         uint64_t morton) const {
  const uint64_t at = ColorSection::lower_bound(tier, code);
  ColorRegion region;
  if (at == tier.region_count || !ColorSection::region(tier, at, region) || region.morton != code)
    file_.broken_section(section_, voxdag_reader::region_text(tier, code) +
                                       " is missing or damaged, expected an entry with counts "
                                       "and an offset within the section");
  EncodedRegion copied;
  copied.morton = morton;
  std::copy(std::begin(region.counts), std::end(region.counts), copied.counts.begin());
  const std::byte* const bytes = reinterpret_cast<const std::byte*>(region.blocks);
  copied.blocks.assign(bytes, bytes + (region.cells + 31) / 32 * 16);
  for (uint32_t table = 0; table < 2; ++table)
    for (uint64_t i = 0; i < region.prefix_count(table); ++i)
      copied.prefix.push_back(region.prefix(table, i));
  copied.total = sum_of(region.color(region.cells - 1), region.counts[0]);
  return copied;
}

uint32_t StoredSection::value(const ColorRegion& region, uint64_t i, uint32_t level,
                              uint64_t code) const {
  const uint32_t value = region.value(i);
  if (const char* expected = value_error(traits_.encoding, value, section_.names().size()))
    broken_cell(level, code, "has the value " + std::to_string(value) + ": " + expected);
  return value;
}

void StoredSection::broken_cell(uint32_t level, uint64_t code, const std::string& what) const {
  file_.broken_section(section_, "the cell of level " + std::to_string(level) +
                                     " with Morton code " + std::to_string(code) + " " + what);
}

}  // namespace voxdag::query
