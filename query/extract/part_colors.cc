#include "query/extract/part_colors.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "core/base/page_buffer.h"
#include "core/base/parallel_for.h"
#include "core/base/process_limits.h"
#include "core/color/blocks/value_region.h"
#include "core/color/cell_values.h"
#include "core/color/color_of.h"
#include "core/format/color/attribute_section_writer.h"
#include "core/format/color/color_layout.h"
#include "core/format/global/open_global.h"
#include "core/geometry/morton.h"
#include "query/dag/dag_view.h"
#include "query/extract/node_reader.h"

namespace voxdag::query {
namespace {

using voxdag_reader::ColorRegion;
using voxdag_reader::ColorSection;
using voxdag_reader::ColorTier;

// In this file, a region is a color region (part_colors.h). The selection's region, a box of cells,
// is always called the selection's region.
constexpr uint64_t kMaxRegionCells = uint64_t{1} << 3 * kRegionLevels;
// Memory of one thread while it encodes a region: the sums of the region's cells and of the next
// coarser cells (1/8 as many), two colors per cell, and one checksum block.
constexpr uint64_t kWorkerBytes =
    kMaxRegionCells * (sizeof(ColoredCell) * 9 / 8 + 2 * sizeof(Color)) +
    CheckedReader::kBlockBytes;
// Returns an upper bound on the size of an encoded region, in bytes. A color takes half a byte (16
// bytes per 32 cells); a value of another attribute takes value_bytes(). The factors are 3/4 and
// 5/4 instead of 1/2 and 1, because a region also has its coarser cells (up to 1/7 as many) and
// prefixes (docs/format.md).
uint64_t encoded_bytes(const voxdag_reader::File& file, Attribute attribute) {
  if (traits_of(attribute).is_color()) return kMaxRegionCells * 3 / 4;
  return kMaxRegionCells * 5 / 4 *
         value_bytes(attribute, section_of(file, attribute).names().size());
}
// Number of regions that are encoded together before they are written.
constexpr size_t kBatchRegions = 32;

// A cube of a level of the file that has set voxels. `code` is the Morton code of the cube's
// position in its level.
struct PlacedCube {
  uint64_t code = 0;
  uint64_t content = 0;  // see DagView
};

// Returns the sum of the colors of `n` cells that all have the color `rgb`.
ColorSum sum_of(const voxdag_reader::Rgb& rgb, uint64_t n) {
  ColorSum sum;
  const uint8_t channels[3] = {rgb.r, rgb.g, rgb.b};
  for (size_t c = 0; c < 3; ++c) sum.plain[c] = n * color::intensity_of(channels[c]);
  sum.seen = sum.plain;
  sum.weight = sum.seen_weight = n;
  return sum;
}

// Releases the pages of a mapped file when the process exceeds its budget. Thread-safe.
class ResidentPages {
 public:
  ResidentPages(const voxdag_reader::File& file, uint64_t limit_bytes, unsigned threads)
      : file_(file), limit_bytes_(limit_bytes), threads_(threads) {}
  // Must be called for each node that is read. Calls check() often enough that the process remains
  // within its budget.
  void visit() const {
    thread_local uint64_t visits_left = 0;
    if (visits_left-- == 0) visits_left = check();
  }
  // Releases pages if the process is over its budget. Returns the number of nodes that this thread
  // may read before the next call.
  uint64_t check() const {
    const uint64_t bytes = resident_bytes();
    if (bytes > limit_bytes_) file_.release_pages();
    const uint64_t free_bytes = limit_bytes_ - std::min(bytes, limit_bytes_);
    return std::max(kMinVisits, free_bytes / kVisitBytes) / threads_;
  }

 private:
  // Number of bytes that the system can load for one access to a page that is not in memory.
  static constexpr uint64_t kVisitBytes = uint64_t{64} << 10;
  static constexpr uint64_t kMinVisits = 512;  // these can load 32 MiB
  const voxdag_reader::File& file_;
  const uint64_t limit_bytes_;
  const unsigned threads_;
};

class PartColors {
 public:
  PartColors(const ColoredPart& part, Attribute attribute, FileSystem& files, MemoryBudget& budget,
             unsigned threads, const CancelToken& cancel)
      : part_(part),
        file_(part.file),
        traits_(traits_of(attribute)),
        section_(section_of(part.file, attribute)),
        dag_(part.file),
        source_(files, part.file, budget),
        pages_(part.file, budget.limit(), threads),
        cancel_(cancel),
        levels_(part_color_levels(part, attribute)),
        finest_(levels_ + part.crop.level) {
    const auto& p = part.crop.position;
    crop_code_ = morton_encode(p[0], p[1], p[2]);
  }

  uint32_t levels() const { return levels_; }
  // Returns the file's level whose cubes are the regions of the part's tier `tier`.
  uint32_t region_level(uint32_t tier) const { return finest_of(tier) - depth_of(tier); }

  // Verifies the checksums of the data with which nodes and colors are found: the DAG's levels, the
  // directories of the regions and the list of names.
  void check_index() {
    std::vector<std::byte> block(CheckedReader::kBlockBytes);
    for (uint32_t l = 0; l <= std::min(finest_, file_.brick_level()); ++l) {
      const voxdag_reader::Level& level = file_.level(l);
      source_.check(level.file_offset, level.word_count * sizeof(uint32_t), block);
    }
    for (uint32_t t = 0; t < section_.tier_count(); ++t) {
      const ColorTier& tier = section_.tier(t);
      source_.check(offset_of(tier.directory), tier.region_count * color_layout::kRegionEntryBytes,
                    block);
    }
    // The list of names follows the last directory.
    const ColorTier& last = section_.tier(section_.tier_count() - 1);
    if (traits_.has_names())
      source_.check(offset_of(last.directory) + last.region_count * color_layout::kRegionEntryBytes,
                    list_bytes(section_.names()), block);
  }

  // Calls visit(cube) for the cube of each region in the part's finest tier, in Morton order.
  template <class Visit>
  void for_each_region(const Visit& visit) const {
    const auto place = [&](const auto& self, uint32_t level, const PlacedCube& cube) -> void {
      if (level >= part_.crop.level) return walk(level, cube, region_level(0), visit);
      const uint64_t next = crop_code_ >> 3 * (part_.crop.level - level - 1);
      const DagView::Children children = children_of(level, cube);
      const int index = static_cast<int>(next & 7);
      if (children.has(index)) self(self, level + 1, {next, dag_.content(level, children, index)});
    };
    place(place, 0, {0, dag_.root()});
  }

  EncodedRegion encode(const PlacedCube& cube) {
    pages_.check();
    const uint32_t level = region_level(0);
    if (traits_.is_color() && is_copied(0, cube.code)) return copy(0, cube.code);
    check_colors(finest_, level, cube.code);
    if (!traits_.is_color()) return encode_valued(cube);
    voxdag_reader::ColorCursor colors(file_);
    std::vector<ColoredCell> cells;
    const uint64_t first = cube.code << 3 * depth_of(0);
    walk(level, cube, finest_, [&](const PlacedCube& cell) {
      cells.push_back({static_cast<uint32_t>(cell.code - first),
                       sum_of(color_of_cell(colors, finest_, cell.code), 1)});
    });
    return encode_cells(0, cube.code, cells);
  }

  // Encodes a region of an attribute other than color. The values of coarser cells are computed
  // from the finest cells by the attribute's rule, as in the file. So a cell that the selection's
  // region does not cut has the same value as in the file.
  EncodedRegion encode_valued(const PlacedCube& cube) const {
    voxdag_reader::ColorCursor cursor(file_, section_);
    std::vector<ValuedCell> cells;
    const uint64_t first = cube.code << 3 * depth_of(0);
    uint32_t bytes = 0;
    walk(region_level(0), cube, finest_, [&](const PlacedCube& cell) {
      uint32_t x, y, z;
      uint64_t i;
      morton_decode(cell.code, x, y, z);
      const ColorRegion* const region = cursor.find(x, y, z, finest_, i);
      if (!region) broken_cell(finest_, cell.code, "has no value, expected one for each cell");
      bytes = region->block_bytes / 32;
      const uint32_t value = region->value(i);
      if (const char* expected = value_error(traits_.encoding, value, section_.names().size()))
        broken_cell(finest_, cell.code, "has the value " + std::to_string(value) + ": " + expected);
      cells.push_back({static_cast<uint32_t>(cell.code - first), value});
    });
    cancel_.check();
    return encode_values(traits_.attribute, bytes, depth_of(0),
                         morton_in_part(region_level(0), cube.code), cells);
  }

  // Encodes a region of a tier above the finest tier. `morton` is the region's Morton code in the
  // part. `cells` are the sums of the region's finest cells.
  EncodedRegion encode_coarse(uint32_t tier, uint64_t morton, std::span<const ColoredCell> cells) {
    const uint32_t level = region_level(tier);
    const uint64_t code = crop_code_ << 3 * (level - part_.crop.level) | morton;
    if (is_copied(tier, code)) return copy(tier, code);
    check_colors(finest_of(tier), level, code);
    return encode_cells(tier, code, cells);
  }

 private:
  uint32_t finest_of(uint32_t tier) const { return finest_ - tier * color_layout::kTierLevels; }
  uint32_t depth_of(uint32_t tier) const {
    return color_layout::levels_in_region(color_layout::finest_level(levels_, tier));
  }
  uint64_t morton_in_part(uint32_t level, uint64_t code) const {
    return code & ((uint64_t{1} << 3 * (level - part_.crop.level)) - 1);
  }
  uint64_t offset_of(const unsigned char* at) const {
    return static_cast<uint64_t>(at - file_.data());
  }

  // Returns the edge of a cube in cells of the selected grid; corner() returns its low corner.
  int64_t edge(uint32_t level) const { return int64_t{1} << (part_.selection.grid_levels - level); }
  std::array<int64_t, 3> corner(uint32_t level, uint64_t code) const {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    return {x * edge(level), y * edge(level), z * edge(level)};
  }
  bool is_whole(uint32_t level, uint64_t code) const {
    return part_.selection.region.contains(corner(level, code), edge(level));
  }
  bool is_selected(uint32_t level, const PlacedCube& cube) const {
    if (is_whole(level, cube.code)) return true;
    if (!part_.selection.region.intersects(corner(level, cube.code), edge(level))) return false;
    const DagView::Children children = children_of(level, cube);
    for (int i = 0; i < 8; ++i)
      if (children.has(i) && is_selected(level + 1, child(level, cube, children, i))) return true;
    return false;
  }
  DagView::Children children_of(uint32_t level, const PlacedCube& cube) const {
    pages_.visit();
    return dag_.children(level, cube.content);
  }
  PlacedCube child(uint32_t level, const PlacedCube& cube, const DagView::Children& children,
                   int index) const {
    return {cube.code << 3 | static_cast<uint64_t>(index), dag_.content(level, children, index)};
  }
  // Calls visit() for each cube of the level `target` that is inside `cube` and has selected cells.
  // `level` is the level of `cube`.
  template <class Visit>
  void walk(uint32_t level, const PlacedCube& cube, uint32_t target, const Visit& visit) const {
    if (!is_selected(level, cube)) return;
    if (level == target) return visit(cube);
    const DagView::Children children = children_of(level, cube);
    for (int i = 0; i < 8; ++i)
      if (children.has(i)) walk(level + 1, child(level, cube, children, i), target, visit);
  }

  // True if the part's region at `code` can be copied, because the file has the same region.
  bool is_copied(uint32_t tier, uint64_t code) const {
    const uint32_t finest = finest_of(tier);
    if (finest > section_.color_levels()) return false;
    const ColorTier& stored = section_.tier_of(finest);
    return stored.finest_level == finest && stored.region_level == region_level(tier) &&
           is_whole(region_level(tier), code);
  }
  EncodedRegion copy(uint32_t tier, uint64_t code) {
    check_colors(finest_of(tier), region_level(tier), code);
    const ColorTier& stored = section_.tier_of(finest_of(tier));
    const uint64_t at = ColorSection::lower_bound(stored, code);
    ColorRegion region;
    if (at == stored.region_count || !ColorSection::region(stored, at, region) ||
        region.morton != code)
      file_.broken_section(section_, voxdag_reader::region_text(stored, code) +
                                         " is missing or damaged, expected an entry with counts "
                                         "and an offset within the section");
    EncodedRegion copied;
    copied.morton = morton_in_part(region_level(tier), code);
    std::copy(std::begin(region.counts), std::end(region.counts), copied.counts.begin());
    const std::byte* const bytes = reinterpret_cast<const std::byte*>(region.blocks);
    copied.blocks.assign(bytes, bytes + (region.cells + 31) / 32 * 16);
    for (uint32_t table = 0; table < 2; ++table)
      for (uint64_t i = 0; i < region.prefix_count(table); ++i)
        copied.prefix.push_back(region.prefix(table, i));
    copied.total = sum_of(region.color(region.cells - 1), region.counts[0]);
    return copied;
  }

  // Verifies the checksums of the colors of a cube, which is at `code` on `level`, and of all its
  // cells down to the level `finest`.
  void check_colors(uint32_t finest, uint32_t level, uint64_t code) {
    std::vector<std::byte> block(CheckedReader::kBlockBytes);
    for (uint32_t t = 0; t < section_.tier_count(); ++t) {
      const ColorTier& tier = section_.tier(t);
      const bool is_coarser = t > 0 && tier.finest_level < level;
      if (is_coarser || tier.region_level > finest) continue;
      // The colors of the cube are in the regions with Morton codes from `begin` to end - 1.
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
  voxdag_reader::Rgb color_of_cell(voxdag_reader::ColorCursor& colors, uint32_t level,
                                   uint64_t code) const {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    const auto rgb = colors.color(x, y, z, level);
    if (!rgb) broken_cell(level, code, "has no color, expected one for each cell");
    return *rgb;
  }
  [[noreturn]] void broken_cell(uint32_t level, uint64_t code, const std::string& what) const {
    file_.broken_section(section_, "the cell of level " + std::to_string(level) +
                                       " with Morton code " + std::to_string(code) + " " + what);
  }

  EncodedRegion encode_cells(uint32_t tier, uint64_t code, std::span<const ColoredCell> cells) {
    const uint32_t depth = depth_of(tier), level = region_level(tier);
    voxdag_reader::ColorCursor colors(file_);
    const auto color = [&](uint32_t up, const ColoredCell& cell) {
      const uint32_t cell_level = level + depth - up;
      const uint64_t cell_code = code << 3 * (depth - up) | cell.code;
      // The sum of a finest cell is already the cell's color.
      if ((tier == 0 && up == 0) || !is_whole(cell_level, cell_code)) return color_of(cell.sum);
      const voxdag_reader::Rgb rgb = color_of_cell(colors, cell_level, cell_code);
      return Color{{rgb.r, rgb.g, rgb.b}, 255};
    };
    cancel_.check();
    return encode_region(depth, morton_in_part(level, code), cells, color);
  }

  const ColoredPart& part_;
  const voxdag_reader::File& file_;
  const AttributeTraits& traits_;
  const ColorSection& section_;
  const DagView dag_;
  CheckedReader source_;
  const ResidentPages pages_;
  const CancelToken& cancel_;
  const uint32_t levels_;  // number of levels of the part's color grid
  const uint32_t finest_;  // level of the file that has the cells of the part's color grid
  uint64_t crop_code_ = 0;
};

// Encodes regions on all threads, and writes them in order.
class RegionWriter {
 public:
  RegionWriter(PartColors& colors, AttributeSectionWriter& section, unsigned workers,
               Progress& progress)
      : colors_(colors), section_(section), workers_(workers), progress_(progress) {
    batch_.reserve(kBatchRegions);
  }
  void add(const PlacedCube& cube) {
    batch_.push_back(cube);
    if (batch_.size() == kBatchRegions) flush();
  }
  void flush() {
    std::vector<EncodedRegion> regions(batch_.size());
    parallel_for_in_order(
        workers_, batch_.size(),
        [&](unsigned, size_t i) { regions[i] = colors_.encode(batch_[i]); },
        [&](unsigned, size_t i) {
          section_.add_region(regions[i]);
          regions[i] = {};
        });
    progress_.advance(batch_.size());
    batch_.clear();
  }

 private:
  PartColors& colors_;
  AttributeSectionWriter& section_;
  const unsigned workers_;
  Progress& progress_;
  std::vector<PlacedCube> batch_;
};

}  // namespace

uint32_t part_color_levels(const ColoredPart& part, Attribute attribute) {
  const uint32_t finest =
      std::min(section_of(part.file, attribute).color_levels(), part.selection.grid_levels);
  return std::max(finest, part.crop.level + kBrickLevels) - part.crop.level;
}

void write_part_attribute(const ColoredPart& part, Attribute attribute, FileSystem& files,
                          GlobalFileWriter& out, MemoryBudget& budget, unsigned threads,
                          Progress& progress, const CancelToken& cancel) {
  progress.begin_stage(name_of(attribute), 0, "regions");
  const MemoryCharge encoded(budget, kBatchRegions * encoded_bytes(part.file, attribute),
                             "encoded colors");
  const auto workers = static_cast<unsigned>(
      std::clamp<uint64_t>(budget.available() / (2 * kWorkerBytes), 1, std::max(threads, 1u)));
  const MemoryCharge work(budget, workers * kWorkerBytes, "the cells of colored regions");
  PartColors colors(part, attribute, files, budget, workers, cancel);
  colors.check_index();
  AttributeSectionWriter section(
      out, attribute, colors.levels(), section_of(part.file, attribute).names(), budget,
      [&](uint32_t tier, uint64_t morton, std::span<const ColoredCell> cells) {
        return colors.encode_coarse(tier, morton, cells);
      });
  RegionWriter writer(colors, section, workers, progress);
  colors.for_each_region([&](const PlacedCube& cube) { writer.add(cube); });
  writer.flush();
  section.finish();
  part.file.release_pages();
  progress.end_stage();
}

}  // namespace voxdag::query
