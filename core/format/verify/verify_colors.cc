#include "core/format/verify/verify_colors.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/color/blocks/value_region.h"
#include "core/format/color/color_layout.h"
#include "core/format/global/open_global.h"

namespace voxdag {
namespace {

using voxdag_reader::ColorRegion;
using voxdag_reader::ColorSection;
using voxdag_reader::ColorTier;

// Walks the set cells of the DAG below a cube, in Morton order. Thread-safe.
class CellWalk {
 public:
  CellWalk(const voxdag_reader::File& file, PageLimit& pages) : file_(file), pages_(pages) {}

  // Calls visit(level, code) for the cells of all levels from `level` to `finest`, each parent
  // before its children. `code` is the cell's Morton code within the cube.
  template <class Visit>
  void walk(uint32_t level, uint64_t place, uint64_t code, uint32_t finest, Visit& visit) const {
    visit(level, code);
    if (level == finest) return;
    const uint32_t mask = mask_at(level, place);
    for (int i = 0; i < 8; ++i)
      if (mask >> i & 1)
        walk(level + 1, child_place_at(file_, level, place, i), 8 * code + static_cast<uint64_t>(i),
             finest, visit);
  }
  // Returns the number of set cells of level `target` in a cube. If there are more than `limit`
  // cells, stops early and returns a number above `limit`. Without the limit, counting could take
  // forever: a few nodes, shared often, can represent 8^20 cells.
  uint64_t count(uint32_t level, uint64_t place, uint32_t target, uint64_t limit) const {
    if (level == target) return 1;
    uint64_t cells = 0;
    const uint32_t mask = mask_at(level, place);
    for (int i = 0; i < 8 && cells <= limit; ++i)
      if (mask >> i & 1)
        cells += count(level + 1, child_place_at(file_, level, place, i), target, limit - cells);
    return cells;
  }
  // Sets `place` to the place (open_global.h) of the cube with Morton code `code`. Returns false if
  // the cube is not set.
  bool find(uint32_t level, uint64_t code, uint64_t& place) const {
    place = 0;
    for (uint32_t l = 0; l < level; ++l) {
      const auto index = static_cast<int>(code >> 3 * (level - l - 1) & 7);
      if (!(mask_at(l, place) >> index & 1)) return false;
      place = child_place_at(file_, l, place, index);
    }
    return true;
  }

 private:
  // The nodes are at random places, and the system loads up to 64 KiB at each of them.
  static constexpr uint64_t kNodeReadBytes = uint64_t{64} << 10;
  static constexpr uint32_t kNodesPerReport = 128;

  uint32_t mask_at(uint32_t level, uint64_t place) const {
    thread_local uint32_t nodes = 0;
    if (level <= file_.brick_level() && ++nodes % kNodesPerReport == 0)
      pages_.touch(kNodesPerReport * kNodeReadBytes);
    return child_mask_at(file_, level, place);
  }

  const voxdag_reader::File& file_;
  PageLimit& pages_;
};

// Message about a region's directory entry that ColorSection::region() refuses.
constexpr const char* kBrokenEntry =
    "a count of cells or the offset of its data is out of range: expected at most the cells of the "
    "region's cube, and data within the section";

class ColorVerifier {
 public:
  ColorVerifier(const voxdag_reader::File& file, Attribute attribute, PageLimit& pages)
      : file_(file),
        traits_(traits_of(attribute)),
        section_(section_of(file, attribute)),
        cells_(file, pages) {}

  bool is_number_of_regions(const ColorTier& tier) const {
    return cells_.count(0, 0, tier.region_level, tier.region_count) == tier.region_count;
  }

  // Checks one region and returns it.
  ColorRegion check_region(const ColorTier& tier, uint64_t i) const {
    ColorRegion region;
    if (!ColorSection::region(tier, i, region)) fail(tier, i, kBrokenEntry);
    for (int at = 29; at < 32; ++at)
      if (tier.directory[32 * i + static_cast<uint64_t>(at)] != 0)
        fail(tier, i,
             "the reserved byte " + std::to_string(at) + " of its directory entry is " +
                 std::to_string(tier.directory[32 * i + static_cast<uint64_t>(at)]) +
                 ", expected 0");
    uint64_t place;
    if (region.morton >> 3 * tier.region_level != 0 ||
        !cells_.find(tier.region_level, region.morton, place))
      fail(tier, i, "the DAG has no cells in this region: expected no entry for it");
    std::array<uint32_t, kRegionLevels + 1> counts{};
    std::vector<uint32_t> prefix[2];
    std::vector<ValuedCell> finest;  // unused for colors
    const auto visit = [&](uint32_t level, uint64_t code) {
      const uint32_t coarser = tier.finest_level - level;
      if (coarser >= kPrefixLevels && coarser - kPrefixLevels < 2 && level > tier.region_level)
        prefix[coarser - kPrefixLevels].push_back(counts[coarser - kPrefixLevels]);
      ++counts[coarser];
      if (coarser == 0 && !traits_.is_color()) finest.push_back({static_cast<uint32_t>(code), 0});
    };
    cells_.walk(tier.region_level, place, 0, tier.finest_level, visit);
    for (uint32_t j = 0; j < counts.size(); ++j)
      if (counts[j] != region.counts[j])
        fail(tier, i,
             std::to_string(region.counts[j]) + " values on level " +
                 std::to_string(tier.finest_level - j) + ": expected " + std::to_string(counts[j]) +
                 ", the number of the DAG's cells");
    for (uint32_t table = 0; table < 2; ++table)
      for (uint64_t entry = 0; entry < region.prefix_count(table); ++entry)
        if (region.prefix(table, entry) != prefix[table][entry])
          fail(tier, i,
               "prefix " + std::to_string(entry) + " is " +
                   std::to_string(region.prefix(table, entry)) + ": expected " +
                   std::to_string(prefix[table][entry]) + ", the number of cells before it");
    check_padding(tier, i, region);
    if (traits_.is_color())
      check_blocks(tier, i, region);
    else
      check_values(tier, i, region, finest);
    return region;
  }

  [[noreturn]] void fail(const ColorTier& tier, const std::string& what) const {
    throw Error(ErrorCode::kCorrupt, file_.path() + ": " + traits_.plural + " of level " +
                                         std::to_string(tier.finest_level) + what);
  }
  [[noreturn]] void fail(const ColorTier& tier, uint64_t i, const std::string& what) const {
    fail(tier, ", region " + std::to_string(i) + ": " + what);
  }

 private:
  void check_blocks(const ColorTier& tier, uint64_t i, const ColorRegion& region) const {
    const uint64_t blocks = (region.cells + 31) / 32;
    for (uint64_t b = 0; b < blocks; ++b) {
      const auto there = static_cast<unsigned>(std::min<uint64_t>(32, region.cells - 32 * b));
      if (!is_canonical(region.blocks + 16 * b, there))
        fail(tier, i,
             "block " + std::to_string(b) +
                 " is not canonical: expected the larger end first, and weights 0 for "
                 "missing cells and for equal ends");
    }
  }
  void check_padding(const ColorTier& tier, uint64_t i, const ColorRegion& region) const {
    const uint64_t blocks = (region.cells + 31) / 32;
    const uint64_t prefix_bytes = 4 * (region.prefix_count(0) + region.prefix_count(1));
    for (uint64_t at = region.block_bytes * blocks + prefix_bytes; at < 16 * region.units(); ++at)
      if (region.blocks[at] != 0)
        fail(tier, i,
             "byte " + std::to_string(at) + " of its data is padding: expected 0, not " +
                 std::to_string(region.blocks[at]));
  }

  // Checks the values of a region of an attribute other than colors. `cells` are the region's cells
  // of the finest level. Sets their values.
  void check_values(const ColorTier& tier, uint64_t i, const ColorRegion& region,
                    std::vector<ValuedCell>& cells) const {
    const auto fail_at = [&](size_t at, const std::string& what) {
      fail(tier, i,
           "value " + std::to_string(region.value(at)) + " of cell " + std::to_string(at) + ": " +
               what);
    };
    for (size_t at = 0; at < cells.size(); ++at) {
      const uint32_t value = cells[at].value = region.value(at);
      if (const char* expected = value_error(traits_.encoding, value, section_.names().size()))
        fail_at(at, expected);
      if (tier.finest_level != section_.color_levels() &&
          value != value_from_below(tier,
                                    region.morton << 3 * (region.level_count - 1) | cells[at].code))
        fail_at(at, "expected the value computed from its children");
    }
    const EncodedRegion expected = encode_values(traits_.attribute, region.block_bytes / 32,
                                                 region.level_count - 1, region.morton, cells);
    const auto* const stored = reinterpret_cast<const std::byte*>(region.blocks);
    const auto differing = std::mismatch(expected.blocks.begin(), expected.blocks.end(), stored);
    if (differing.first != expected.blocks.end())
      fail(tier, i,
           "byte " + std::to_string(differing.first - expected.blocks.begin()) +
               " of its data is wrong: expected the value computed from the children of its cell, "
               "or 0 after the last value");
  }

  // Returns the value that a cell of a tier's finest level must have. This value is computed from
  // the regions of the finer tier in this cell.
  uint32_t value_from_below(const ColorTier& tier, uint64_t code) const {
    const ColorTier& below = section_.tier_of(tier.finest_level + 1);
    uint32_t children[8];
    size_t count = 0;
    for (uint64_t i = ColorSection::lower_bound(below, code << 3); i < below.region_count; ++i) {
      ColorRegion region;
      if (!ColorSection::region(below, i, region)) fail(below, i, kBrokenEntry);
      if (region.morton >> 3 != code || count == 8) break;
      children[count++] = region.value(region.cells - 1);
    }
    if (count == 0)
      fail(tier, ": the cell with Morton code " + std::to_string(code) +
                     " has no regions in the next finer tier: expected at least one");
    return traits_.value_of_parent(std::span(children, count));
  }

  static bool is_canonical(const unsigned char* block, unsigned cells) {
    const auto bits = [&](unsigned bit, unsigned count) {
      uint32_t value = 0;
      for (unsigned n = count; n-- > 0;)
        value = value << 1 | (block[(bit + n) / 8] >> (bit + n) % 8 & 1u);
      return value;
    };
    const bool mode_b = bits(0, 16) == 0;
    const uint32_t first = mode_b ? bits(16, 24) : bits(0, 16);
    const uint32_t second = mode_b ? bits(40, 24) : bits(16, 16);
    if (first < second || (first == second && !mode_b)) return false;
    const unsigned width = mode_b ? 2 : 3, begin = mode_b ? 64 : 32;
    const unsigned used = first == second ? 0 : width * cells;
    for (unsigned bit = begin + used; bit < 128; ++bit)
      if (bits(bit, 1) != 0) return false;
    return true;
  }

  const voxdag_reader::File& file_;
  const AttributeTraits& traits_;
  const ColorSection& section_;
  const CellWalk cells_;
};

void verify_section(const voxdag_reader::File& file, Attribute attribute, unsigned threads,
                    Progress& progress, const CancelToken& cancel, PageLimit& pages) {
  const ColorVerifier verifier(file, attribute, pages);
  const ColorSection& section = section_of(file, attribute);
  for (uint32_t t = 0; t < section.tier_count(); ++t) {
    const ColorTier& tier = section.tier(t);
    if (!verifier.is_number_of_regions(tier))
      verifier.fail(tier, ": " + std::to_string(tier.region_count) +
                              " regions: expected as many as the DAG has cells on level " +
                              std::to_string(tier.region_level));
    progress.begin_stage("verify " + std::string(traits_of(attribute).plural), tier.region_count,
                         "regions");
    std::atomic<uint64_t> cells = 0;
    parallel_for(threads, tier.region_count, [&](unsigned, size_t i) {
      cancel.check();
      const ColorRegion region = verifier.check_region(tier, i);
      uint64_t expected = 0;
      ColorRegion before;
      if (i > 0 && !ColorSection::region(tier, i - 1, before))
        verifier.fail(tier, i - 1, kBrokenEntry);
      if (i > 0) expected = before.first_unit + before.units();
      if (region.first_unit != expected)
        verifier.fail(tier, i,
                      "its data begin at unit " + std::to_string(region.first_unit) +
                          " of 16 bytes: expected " + std::to_string(expected) +
                          (i > 0 ? ", the end of the previous region" : ", the first unit"));
      if (i > 0 && region.morton <= before.morton)
        verifier.fail(tier, i,
                      "its Morton code is " + std::to_string(region.morton) +
                          ": expected more than the previous region's " +
                          std::to_string(before.morton));
      if (i + 1 == tier.region_count && region.first_unit + region.units() != tier.units)
        verifier.fail(tier, i,
                      "its data end at unit " + std::to_string(region.first_unit + region.units()) +
                          " of 16 bytes: expected " + std::to_string(tier.units) +
                          ", the end of the tier, because it is the last region");
      cells += region.cells;
      pages.touch(color_layout::kUnitBytes * region.units());
      progress.advance(1);
    });
    if (cells != tier.cell_count)
      verifier.fail(tier, ": " + std::to_string(cells) + " cells in all regions: expected " +
                              std::to_string(tier.cell_count) + ", the number in the tier table");
    progress.end_stage();
  }
}

}  // namespace

void verify_colors(const voxdag_reader::File& file, unsigned threads, Progress& progress,
                   const CancelToken& cancel, PageLimit& pages) {
  with_reader_errors([&] {
    for (const AttributeTraits& row : kAttributeTable)
      verify_section(file, row.attribute, threads, progress, cancel, pages);
  });
}

}  // namespace voxdag
