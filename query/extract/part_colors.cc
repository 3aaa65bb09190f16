#include "query/extract/part_colors.h"

#include <algorithm>
#include <string>
#include <vector>

#include "core/color/blocks/value_region.h"
#include "core/color/color_of.h"
#include "core/format/color/attribute_section_writer.h"
#include "core/format/color/color_layout.h"
#include "core/format/global/open_global.h"
#include "core/geometry/morton.h"
#include "query/attributes/placed_cube.h"
#include "query/attributes/region_batches.h"
#include "query/attributes/resident_pages.h"
#include "query/attributes/stored_section.h"
#include "query/dag/dag_view.h"

namespace voxdag::query {
namespace {

using voxdag_reader::ColorRegion;
using voxdag_reader::ColorSection;
using voxdag_reader::ColorTier;

// In this file, a region is a color region (part_colors.h). The selection's region, a box of cells,
// is always called the selection's region.
class PartColors {
 public:
  PartColors(const ColoredPart& part, Attribute attribute, FileSystem& files, MemoryBudget& budget,
             unsigned threads, const CancelToken& cancel)
      : part_(part),
        file_(part.file),
        traits_(traits_of(attribute)),
        section_(section_of(part.file, attribute)),
        dag_(part.file),
        stored_(part.file, attribute, files, budget),
        pages_({&part.file}, budget.limit(), threads),
        cancel_(cancel),
        levels_(part_color_levels(part, attribute)),
        finest_(levels_ + part.crop.level) {
    const auto& p = part.crop.position;
    crop_code_ = morton_encode(p[0], p[1], p[2]);
  }

  uint32_t levels() const { return levels_; }
  // Returns the file's level whose cubes are the regions of the part's tier `tier`.
  uint32_t region_level(uint32_t tier) const { return finest_of(tier) - depth_of(tier); }

  // Verifies the data with which nodes and values are found.
  void check_index() { stored_.check_index(finest_, cancel_); }

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
    stored_.check_values(finest_, level, cube.code);
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
      if (!region)
        stored_.broken_cell(finest_, cell.code, "has no value, expected one for each cell");
      bytes = region->block_bytes / 32;
      const uint32_t value = stored_.value(*region, i, finest_, cell.code);
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
    stored_.check_values(finest_of(tier), level, code);
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
    stored_.check_values(finest_of(tier), region_level(tier), code);
    return stored_.copy_region(section_.tier_of(finest_of(tier)), code,
                               morton_in_part(region_level(tier), code));
  }

  voxdag_reader::Rgb color_of_cell(voxdag_reader::ColorCursor& colors, uint32_t level,
                                   uint64_t code) const {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    const auto rgb = colors.color(x, y, z, level);
    if (!rgb) stored_.broken_cell(level, code, "has no color, expected one for each cell");
    return *rgb;
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
  StoredSection stored_;
  const ResidentPages pages_;
  const CancelToken& cancel_;
  const uint32_t levels_;  // number of levels of the part's color grid
  const uint32_t finest_;  // level of the file that has the cells of the part's color grid
  uint64_t crop_code_ = 0;
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
  const std::vector<std::string>& names = section_of(part.file, attribute).names();
  const RegionMemory memory(budget, attribute, names.size(), threads);
  PartColors colors(part, attribute, files, budget, memory.workers(), cancel);
  colors.check_index();
  AttributeSectionWriter section(
      out, attribute, colors.levels(), names, budget,
      [&](uint32_t tier, uint64_t morton, std::span<const ColoredCell> cells) {
        return colors.encode_coarse(tier, morton, cells);
      });
  RegionBatches<EncodedRegion> regions(
      memory.workers(), progress, [&](const PlacedCube& cube) { return colors.encode(cube); },
      [&](const EncodedRegion& region) { section.add_region(region); });
  colors.for_each_region([&](const PlacedCube& cube) { regions.add(cube); });
  regions.flush();
  section.finish();
  part.file.release_pages();
  progress.end_stage();
}

}  // namespace voxdag::query
