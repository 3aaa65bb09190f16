#include "query/attributes/combined_section.h"

#include <algorithm>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/color/blocks/value_region.h"
#include "core/color/cell_values.h"
#include "core/format/color/attribute_section_writer.h"
#include "core/format/color/color_layout.h"
#include "core/format/global/open_global.h"
#include "core/geometry/morton.h"
#include "query/attributes/attribute_source.h"
#include "query/attributes/material_names.h"
#include "query/attributes/placed_cube.h"
#include "query/attributes/region_batches.h"
#include "query/attributes/resident_pages.h"
#include "query/dag/dag_view.h"
#include "query/lookup/nearest.h"
#include "voxdag/cells.h"

namespace voxdag::query {
namespace {

using voxdag_reader::ColorCursor;
using voxdag_reader::ColorRegion;
using voxdag_reader::ColorSection;

// In this file, levels and codes are levels and Morton codes of the result's grid, except where a
// name begins with `file_`: these are levels and codes of a source's grid. A region is a color
// region (combined_section.h), and a tier is a group of seven levels (docs/format.md, "Colors").

// An encoded region, and the index of the source from which it was copied; kEncoded if it was
// encoded.
constexpr size_t kEncoded = ~size_t{0};
struct MadeRegion {
  EncodedRegion region;
  size_t copied_from = kEncoded;
};

class CombinedColors {
 public:
  CombinedColors(const CombinedFiles& from, const CombinedAttribute& attribute, FileSystem& files,
                 MemoryBudget& budget, const CancelToken& cancel)
      : traits_(traits_of(attribute.attribute)),
        result_(from.result),
        dag_(from.result),
        moved_b_(from.moved_b),
        moved_b_dag_(from.moved_b),
        fill_(from.fill),
        nearest_reach_(from.nearest_reach),
        cancel_(cancel),
        levels_(from.levels),
        names_charge_(budget, 0, "lists of materials") {
    const uint32_t levels = result_.grid_levels();
    if (attribute.from_a)
      sources_.push_back(std::make_unique<AttributeSource>(from.a, attribute.attribute, levels,
                                                           Position{}, files, budget));
    if (attribute.from_b)
      sources_.push_back(std::make_unique<AttributeSource>(from.b, attribute.attribute, levels,
                                                           from.offset, files, budget));
    // Without a fill color, B has a voxel in each cell in which A has none.
    tests_b_ = attribute.from_b && fill_ && !sources_.back()->is_aligned(levels_);
    below_.resize(color_layout::tier_count(levels_));
    if (traits_.has_names()) join_materials();
  }

  // Number of levels of the grid of finest cells.
  uint32_t levels() const { return levels_; }
  // The list of materials.
  const std::vector<std::string>& names() const { return names_; }
  // Must be called before the functions below. `workers` is the number of threads that call make().
  void start(uint64_t limit_bytes, unsigned workers) {
    std::vector<const voxdag_reader::File*> mapped = {&result_};
    for (const auto& source : sources_) {
      source->stored().check_index(static_cast<uint32_t>(source->file_level(levels_)), cancel_);
      mapped.push_back(&source->stored().file());
    }
    if (tests_b_) mapped.push_back(&moved_b_);
    pages_ = std::make_unique<ResidentPages>(std::move(mapped), limit_bytes, workers);
  }
  void release_pages() const { pages_->release(); }

  // Calls visit(cube) for the cube of each region in the finest tier, in Morton order.
  template <class Visit>
  void for_each_region(const Visit& visit) const {
    walk(0, {0, dag_.root()}, region_level(0), visit);
  }

  // Makes a region of the finest tier. Thread-safe.
  MadeRegion make(const PlacedCube& cube) {
    pages_->check();
    cancel_.check();
    const uint32_t level = region_level(0);
    if (const auto from = copy_source(cube); from != kEncoded)
      return {copy(*sources_[from], 0, cube.code), from};
    for (const auto& source : sources_) source->check_values(levels_, level, cube.code);
    Readers readers;
    for (const auto& source : sources_)
      readers.cursors.emplace_back(source->stored().file(), source->section());
    return {traits_.is_color() ? encode_colors(cube, readers) : encode_valued(cube, readers)};
  }

  // Counts a written region for the region of the next coarser tier that contains it. Must be
  // called for the regions in the order in which they are written.
  void count_region(uint32_t tier, uint64_t code, size_t copied_from) {
    if (!traits_.is_color() || tier + 1 == below_.size()) return;
    const uint64_t parent = code >> 3 * (1 + depth_of(tier + 1));
    Below& below = below_[tier + 1][parent];
    ++below.regions;
    if (copied_from != kEncoded) ++below.copied[copied_from];
  }

  // Makes a region of a tier above the finest tier. `cells` are the sums of its finest cells.
  EncodedRegion make_coarse(uint32_t tier, uint64_t code, std::span<const ColoredCell> cells) {
    const auto open = below_[tier].find(code);
    const Below below = open->second;
    below_[tier].erase(open);
    size_t from = 0;
    while (from < sources_.size() &&
           !is_copied_coarse(*sources_[from], below.copied[from], below.regions, tier, code))
      ++from;
    const bool is_copied = from < sources_.size();
    count_region(tier, code, is_copied ? from : kEncoded);
    if (is_copied) return copy(*sources_[from], tier, code);
    return encode_region(depth_of(tier), code, cells);
  }

 private:
  // Counts the regions in a region of the next coarser tier: all of them, and those that were
  // copied from each source.
  struct Below {
    uint64_t regions = 0;
    std::array<uint64_t, 2> copied = {};
  };

  // Joins the lists of materials. Charges the memory of the joined list, of its encoded form, and
  // of the maps that join_names() uses.
  void join_materials() {
    constexpr uint64_t kBytesPerName = 2 * sizeof(std::string) + 256;
    uint64_t bytes = 0;
    for (const auto& source : sources_) {
      const std::vector<std::string>& names = source->section().names();
      bytes += 2 * list_bytes(names) + kBytesPerName * names.size();
    }
    if (!names_charge_.try_resize(bytes))
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: the lists of materials need " + std::to_string(bytes) +
                      " bytes: expected more memory (" + option_text("memory") + ")");
    names_ = sources_[0]->section().names();
    if (sources_.size() == 1) return;
    JoinedNames joined = join_names(names_, sources_[1]->section().names());
    indices_.resize(2);
    indices_[0].resize(names_.size());
    std::iota(indices_[0].begin(), indices_[0].end(), 0);
    names_ = std::move(joined.names);
    indices_[0].back() = static_cast<uint32_t>(names_.size() - 1);
    indices_[1] = std::move(joined.b);
  }

  uint32_t finest_of(uint32_t tier) const { return color_layout::finest_level(levels_, tier); }
  uint32_t depth_of(uint32_t tier) const { return color_layout::levels_in_region(finest_of(tier)); }
  uint32_t region_level(uint32_t tier) const { return finest_of(tier) - depth_of(tier); }

  DagView::Children children_of(const DagView& dag, uint32_t level, uint64_t content) const {
    pages_->visit();
    return dag.children(level, content);
  }
  // Calls visit() for each cube of the level `target` that is inside `cube`, which is on `level`.
  template <class Visit>
  void walk(uint32_t level, const PlacedCube& cube, uint32_t target, const Visit& visit) const {
    if (level == target) return visit(cube);
    const DagView::Children children = children_of(dag_, level, cube.content);
    for (int i = 0; i < 8; ++i)
      if (children.has(i))
        walk(level + 1,
             {cube.code << 3 | static_cast<uint64_t>(i), dag_.content(level, children, i)}, target,
             visit);
  }

  // True if each region of the tier has the position and the levels of a region of the source, or
  // is outside the source's grid.
  bool has_same_regions(const AttributeSource& source, uint32_t tier) const {
    return source.finest() == levels_ && source.is_aligned(region_level(tier)) &&
           source.file_level(region_level(tier)) >= 0 &&
           color_layout::levels_in_region(
               color_layout::finest_level(source.section().color_levels(), tier)) == depth_of(tier);
  }
  // Returns the cube of a file at `file_code`; nothing if the file has no voxels there. `dag` has
  // the file's voxels.
  std::optional<uint64_t> content_at(const DagView& dag, uint32_t file_level,
                                     uint64_t file_code) const {
    if (dag.empty()) return std::nullopt;
    uint64_t content = dag.root();
    for (uint32_t level = 0; level < file_level; ++level) {
      const DagView::Children children = children_of(dag, level, content);
      const int index = static_cast<int>(file_code >> 3 * (file_level - level - 1) & 7);
      if (!children.has(index)) return std::nullopt;
      content = dag.content(level, children, index);
    }
    return content;
  }
  // True if a cube of the result and a cube of the source have the same finest cells. `content` and
  // `file_content` are the two cubes.
  bool has_same_cells(const AttributeSource& source, uint32_t level, uint64_t content,
                      uint64_t file_content) const {
    if (level == levels_) return true;
    const auto file_level = static_cast<uint32_t>(source.file_level(level));
    if (level + kBrickLevels == result_.grid_levels() && levels_ == result_.grid_levels())
      return content == file_content;
    const DagView::Children children = children_of(dag_, level, content);
    const DagView::Children file_children = children_of(source.dag(), file_level, file_content);
    if (children.mask != file_children.mask) return false;
    for (int i = 0; i < 8; ++i)
      if (children.has(i) && !has_same_cells(source, level + 1, dag_.content(level, children, i),
                                             source.dag().content(file_level, file_children, i)))
        return false;
    return true;
  }
  // Returns the index of the source from which the region of the finest tier is copied, or
  // kEncoded.
  size_t copy_source(const PlacedCube& cube) const {
    if (!traits_.is_color()) return kEncoded;
    const uint32_t level = region_level(0);
    for (size_t i = 0; i < sources_.size(); ++i) {
      const AttributeSource& source = *sources_[i];
      if (!source.is_aligned(level)) return kEncoded;
      const auto file_code = source.file_code(level, cube.code);
      if (!file_code) continue;
      const auto file_content =
          content_at(source.dag(), static_cast<uint32_t>(source.file_level(level)), *file_code);
      if (!file_content) continue;
      // The source has voxels in the region. Its values come first, so the region cannot be copied
      // from a later source.
      const bool is_same =
          has_same_regions(source, 0) && has_same_cells(source, level, cube.content, *file_content);
      return is_same ? i : kEncoded;
    }
    return kEncoded;
  }
  // True if a region of a tier above the finest tier can be copied from the source. This is the
  // case if the source's region contains the same regions of the tier below, and all of them were
  // copied from the source.
  bool is_copied_coarse(const AttributeSource& source, uint64_t copied, uint64_t regions,
                        uint32_t tier, uint64_t code) const {
    if (copied != regions || !has_same_regions(source, tier)) return false;
    const auto file_code = source.file_code(region_level(tier), code);
    if (!file_code) return false;
    const voxdag_reader::ColorTier& finer = source.section().tier(tier - 1);
    const uint32_t bits = 3 * (1 + depth_of(tier));
    return ColorSection::lower_bound(finer, (*file_code + 1) << bits) -
               ColorSection::lower_bound(finer, *file_code << bits) ==
           regions;
  }
  EncodedRegion copy(AttributeSource& source, uint32_t tier, uint64_t code) const {
    const uint64_t file_code = *source.file_code(region_level(tier), code);
    source.check_values(finest_of(tier), region_level(tier), code);
    return source.stored().copy_region(source.section().tier(tier), file_code, code);
  }

  // A cursor for each source, and the codes of the regions of the finest tier outside of the
  // current region whose values in A are verified.
  struct Readers {
    std::vector<ColorCursor> cursors;
    std::vector<uint64_t> verified;
    std::optional<NearestFinder> nearest = {};
  };

  // Finds the value of the cell of A that is nearest to a finest cell. Returns null if A has no
  // value for this cell. Sets `i` as AttributeSource::find() does.
  const ColorRegion* find_nearest_value(Readers& readers, uint64_t code, uint64_t& i) const {
    AttributeSource& source = *sources_[0];
    pages_->visit();
    if (!readers.nearest) readers.nearest.emplace(source.dag(), levels_);
    const Nearest nearest = readers.nearest->find(position_of(code), nearest_reach_);
    if (!nearest.found) no_value(code);
    const uint64_t found = morton_encode(static_cast<uint32_t>(nearest.cell[0]),
                                         static_cast<uint32_t>(nearest.cell[1]),
                                         static_cast<uint32_t>(nearest.cell[2]));
    const uint64_t region = found >> 3 * depth_of(0);
    if (std::ranges::find(readers.verified, region) == readers.verified.end()) {
      source.check_values(levels_, region_level(0), region);
      readers.verified.push_back(region);
    }
    return source.find(readers.cursors[0], levels_, found, i);
  }

  // Finds the value of a finest cell. Calls take(source, region, i) with the index of the source,
  // and the region and index of the value in the source. Calls none() if no source has a value.
  template <class Take, class None>
  void find_value(Readers& readers, uint64_t code, const Take& take, const None& none) const {
    for (size_t s = 0; s < sources_.size(); ++s) {
      const bool is_tested = tests_b_ && s + 1 == sources_.size();
      if (is_tested && !content_at(moved_b_dag_, levels_, code)) continue;
      uint64_t i = 0;
      if (const ColorRegion* const region = sources_[s]->find(readers.cursors[s], levels_, code, i))
        return take(s, *region, i);
    }
    uint64_t i = 0;
    const ColorRegion* const nearest =
        nearest_reach_ > 0 ? find_nearest_value(readers, code, i) : nullptr;
    if (nearest) return take(0, *nearest, i);
    none();
  }
  [[noreturn]] void no_value(uint64_t code) const {
    throw Error(ErrorCode::kCorrupt, "the cell of level " + std::to_string(levels_) +
                                         " with Morton code " + std::to_string(code) +
                                         " of the result has no " + traits_.name +
                                         " in the inputs: expected one for each cell");
  }
  uint32_t code_in_region(const PlacedCube& cube, uint64_t code) const {
    return static_cast<uint32_t>(code - (cube.code << 3 * depth_of(0)));
  }

  EncodedRegion encode_colors(const PlacedCube& cube, Readers& readers) const {
    std::vector<ColoredCell> cells;
    walk(region_level(0), cube, levels_, [&](const PlacedCube& cell) {
      voxdag_reader::Rgb rgb;
      find_value(
          readers, cell.code,
          [&](size_t, const ColorRegion& region, uint64_t i) { rgb = region.color(i); },
          [&] {
            if (!fill_) no_value(cell.code);
            rgb = *fill_;
          });
      cells.push_back({code_in_region(cube, cell.code), sum_of(rgb, 1)});
    });
    return encode_region(depth_of(0), cube.code, cells);
  }
  EncodedRegion encode_valued(const PlacedCube& cube, Readers& readers) const {
    std::vector<ValuedCell> cells;
    walk(region_level(0), cube, levels_, [&](const PlacedCube& cell) {
      find_value(
          readers, cell.code,
          [&](size_t s, const ColorRegion& region, uint64_t i) {
            uint32_t value = sources_[s]->stored().value(region, i, levels_, cell.code);
            if (!indices_.empty()) value = indices_[s][value];
            cells.push_back({code_in_region(cube, cell.code), value});
          },
          [&] { no_value(cell.code); });
    });
    return encode_values(traits_.attribute, value_bytes(traits_.attribute, names_.size()),
                         depth_of(0), cube.code, cells);
  }

  const AttributeTraits& traits_;
  const voxdag_reader::File& result_;
  const DagView dag_;
  const voxdag_reader::File& moved_b_;
  const DagView moved_b_dag_;
  const std::optional<voxdag_reader::Rgb> fill_;
  const uint32_t nearest_reach_;
  const CancelToken& cancel_;
  // A finest cell gets its value from the first source that has a value for it.
  std::vector<std::unique_ptr<AttributeSource>> sources_;
  // True if B, the last source, has values only in cells in which the moved B has voxels. This must
  // be tested, because its cubes do not align with the cells.
  bool tests_b_ = false;
  std::unique_ptr<const ResidentPages> pages_;
  const uint32_t levels_;
  MemoryCharge names_charge_;
  std::vector<std::string> names_;
  // indices_[s][i] is the index in names_ of material i of source s. Empty if there is only one
  // source.
  std::vector<std::vector<uint32_t>> indices_;
  // below_[tier] has an entry for each region of the tier that is not complete: the counts of the
  // regions below it. The key is the code of the region.
  std::vector<std::map<uint64_t, Below>> below_;
};

}  // namespace

int64_t finest_level_of(const voxdag_reader::File& file, Attribute attribute,
                        uint32_t grid_levels) {
  return int64_t{grid_levels} - file.grid_levels() + section_of(file, attribute).color_levels();
}

void write_combined_attribute(const CombinedFiles& from, const CombinedAttribute& attribute,
                              FileSystem& files, GlobalFileWriter& out, MemoryBudget& budget,
                              unsigned threads, Progress& progress, const CancelToken& cancel) {
  progress.begin_stage(name_of(attribute.attribute), 0, "regions");
  CombinedColors colors(from, attribute, files, budget, cancel);
  const RegionMemory memory(budget, attribute.attribute, colors.names().size(), threads);
  colors.start(budget.limit(), memory.workers());
  AttributeSectionWriter section(
      out, attribute.attribute, colors.levels(), colors.names(), budget,
      [&](uint32_t tier, uint64_t morton, std::span<const ColoredCell> cells) {
        return colors.make_coarse(tier, morton, cells);
      });
  RegionBatches<MadeRegion> regions(
      memory.workers(), progress, [&](const PlacedCube& cube) { return colors.make(cube); },
      [&](const MadeRegion& made) {
        colors.count_region(0, made.region.morton, made.copied_from);
        section.add_region(made.region);
      });
  colors.for_each_region([&](const PlacedCube& cube) { regions.add(cube); });
  regions.flush();
  section.finish();
  colors.release_pages();
  progress.end_stage();
}

}  // namespace voxdag::query
