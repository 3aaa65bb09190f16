#include "query/verify/color_sample.h"

#include <algorithm>
#include <random>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/color/blocks/attribute_encoder.h"
#include "core/color/rule/bake_region.h"
#include "core/color/snap_surface.h"
#include "core/format/global/diff_colors.h"
#include "core/format/global/open_global.h"
#include "core/geometry/morton.h"
#include "scene/textures/find_cutouts.h"
#include "scene/textures/texture_set.h"

namespace voxdag::query {
namespace {

// Memory of the cells of a region after baking: their sums in Morton order, and their encoding
// (RegionEncoder), whose next coarser level has at most an eighth of a complete region's cells.
constexpr uint64_t kCellsBytes =
    uint64_t{color::RegionCells::kMaxCells} * (sizeof(ColoredCell) + 10 + 81 / 8 + 1);

using voxdag_reader::ColorRegion;
using voxdag_reader::ColorSection;
using voxdag_reader::ColorTier;

struct SampledRegion {
  // For each attribute, at index_of(attribute): the region as the file stores it. The elements of
  // attributes that the file does not have are unused.
  std::array<ColorRegion, std::size(kAttributeTable)> stored;
  Cube cube;
  std::vector<FixedSurface> surfaces;  // surfaces that can touch the region
};

size_t index_of(Attribute attribute) { return static_cast<size_t>(attribute) - 1; }

std::vector<SampledRegion> draw_regions(const voxdag_reader::File& file, const ColorGrid& grid,
                                        uint64_t seed) {
  const std::vector<Attribute> attributes = attributes_of(file).list();
  const ColorTier& tier = section_of(file, attributes.front()).tier(0);
  std::vector<uint64_t> drawn;
  std::mt19937_64 random(seed);
  for (size_t i = 0; i < kSampleRegions; ++i)
    drawn.push_back(tier.region_count <= kSampleRegions ? i % tier.region_count
                                                        : random() % tier.region_count);
  std::sort(drawn.begin(), drawn.end());
  drawn.erase(std::unique(drawn.begin(), drawn.end()), drawn.end());
  std::vector<SampledRegion> regions(drawn.size());
  for (size_t i = 0; i < drawn.size(); ++i) {
    SampledRegion& region = regions[i];
    // All attributes have the same regions.
    for (const Attribute attribute : attributes)
      if (!ColorSection::region(section_of(file, attribute).tier(0), drawn[i],
                                region.stored[index_of(attribute)]))
        file.broken_section(
            section_of(file, attribute),
            "region " + std::to_string(drawn[i]) +
                " of the finest tier is damaged, expected counts and an offset within the section");
    region.cube.level = grid.region_level();
    auto& [x, y, z] = region.cube.position;
    morton_decode(region.stored[index_of(attributes.front())].morton, x, y, z);
  }
  return regions;
}

bool may_touch(const CellBox& box, const Cube& cube) {
  for (int a = 0; a < 3; ++a) {
    const int64_t at = cube.position[a];
    if (at < box.low[a] || at > box.high[a]) return false;
  }
  return true;
}

void find_surfaces(TriangleSource& scene, const Grid& snap, const ColorGrid& grid,
                   std::vector<SampledRegion>& regions, MemoryCharge& charge, Progress& progress,
                   const CancelToken& cancel) {
  uint64_t bytes = 0;
  progress.begin_stage("surfaces", scene.declared_triangles(), "triangles");
  const auto add = [&](const SurfaceTriangle& triangle) {
    FixedSurface surface;
    if (snap_surface(snap, triangle, surface) != SnapResult::kInside) return;
    const CellBox box(surface.position, grid.levels, grid.region_level());
    for (SampledRegion& region : regions) {
      if (!may_touch(box, region.cube)) continue;
      bytes += 2 * sizeof(FixedSurface);  // a vector can have twice the capacity that it needs
      if (bytes > charge.bytes() && !charge.try_resize(2 * bytes))
        throw Error(ErrorCode::kOutOfMemory,
                    "out of memory: the triangles of the sampled color regions need over " +
                        size_text(bytes) + ": expected more memory (" + option_text("memory") +
                        ")");
      region.surfaces.push_back(surface);
    }
  };
  scene.open(1)->read_surfaces(0, scene.declared_triangles(), [&](auto batch) {
    cancel.check();
    for (const SurfaceTriangle& triangle : batch) add(triangle);
    progress.advance(batch.size());
  });
  progress.end_stage();
}

bool is_same(const EncodedRegion& baked, const ColorRegion& stored) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(baked.blocks.data());
  return std::equal(baked.counts.begin(), baked.counts.end(), stored.counts) &&
         std::equal(bytes, bytes + baked.blocks.size(), stored.blocks);
}

// Returns the difference between the colors of the finest cells in two regions, which must have the
// same number of cells.
ColorDiff difference(const EncodedRegion& baked, const ColorRegion& stored) {
  ColorRegion again;
  again.blocks = reinterpret_cast<const unsigned char*>(baked.blocks.data());
  ColorDiff diff;
  for (uint32_t i = 0; i < stored.counts[0]; ++i) diff.add(again.color(i), stored.color(i));
  return diff;
}

std::string place_of(const Cube& cube, const ColorGrid& grid) {
  const uint32_t down = grid.color_levels - cube.level;
  std::string text;
  for (const uint32_t at : cube.position)
    text += (text.empty() ? "" : " ") + std::to_string(uint64_t{at} << down);
  return text;
}

// Compares the newly baked values of one attribute in a region with the values in the file.
class RegionComparison {
 public:
  RegionComparison(const voxdag_reader::File& file, const ColorGrid& grid,
                   const std::vector<ColoredCell>& cells, const std::vector<CellValues>& values)
      : file_(file), grid_(grid), cells_(cells), values_(values) {}

  // Returns true if all bytes are equal, and false if they differ but `attribute` is a color and
  // the colors are similar (kMinSamplePsnr). Throws Error{kCorrupt} for all other differences.
  bool compare(const SampledRegion& region, Attribute attribute) const {
    const ColorRegion& stored = region.stored[index_of(attribute)];
    const EncodedRegion baked = encode(region.cube, attribute, stored);
    if (is_same(baked, stored)) return true;
    const bool is_near = traits_of(attribute).is_color() && baked.counts[0] == stored.counts[0] &&
                         difference(baked, stored).psnr() >= kMinSamplePsnr;
    if (!is_near)
      throw Error(ErrorCode::kCorrupt,
                  file_.path() + ": the " + traits_of(attribute).plural +
                      " of the region at color cell " + place_of(region.cube, grid_) +
                      " differ from the scene: expected the values that a build of the scene "
                      "stores (the region has " +
                      std::to_string(stored.counts[0]) + " cells in the file and " +
                      std::to_string(baked.counts[0]) + " in the scene)");
    return false;
  }

 private:
  EncodedRegion encode(const Cube& cube, Attribute attribute, const ColorRegion& stored) const {
    if (cells_.empty()) return {};
    AttributeEncoder encoder(attribute, stored.block_bytes / 32, grid_.color_levels - cube.level);
    encoder.add(cells_, values_, 0);
    return encoder.finish(stored.morton);
  }

  const voxdag_reader::File& file_;
  const ColorGrid grid_;
  const std::vector<ColoredCell>& cells_;
  const std::vector<CellValues>& values_;
};

ColorGrid sampled_grid(const voxdag_reader::File& file) {
  const std::vector<Attribute> attributes = attributes_of(file).list();
  const uint32_t levels = section_of(file, attributes.front()).color_levels();
  for (const Attribute attribute : attributes)
    if (section_of(file, attribute).color_levels() != levels ||
        section_of(file, attribute).tier(0).region_count !=
            section_of(file, attributes.front()).tier(0).region_count)
      file.broken_section(
          section_of(file, attribute),
          "the section has " + std::to_string(section_of(file, attribute).tier(0).region_count) +
              " regions and ends at level " +
              std::to_string(section_of(file, attribute).color_levels()) +
              ": expected the same numbers as the " + section_of(file, attributes.front()).name());
  return {file.grid_levels(), levels};
}

// Throws Error{kCorrupt} if the file's list of materials is not `expected`, the scene's list.
void compare_materials(const voxdag_reader::File& file, const std::vector<std::string>& expected) {
  const std::vector<std::string> names = file.material_names();
  if (names.size() != expected.size())
    throw Error(ErrorCode::kCorrupt, file.path() + ": its list of materials has " +
                                         std::to_string(names.size()) + " names, expected " +
                                         std::to_string(expected.size()) + ", as in the scene");
  for (size_t i = 0; i < names.size(); ++i)
    if (names[i] != expected[i])
      throw Error(ErrorCode::kCorrupt, file.path() + ": material " + std::to_string(i) +
                                           " of its list is '" + names[i] + "', expected '" +
                                           expected[i] + "', as in the scene");
}

}  // namespace

ColorSampleReport compare_sampled_colors(const voxdag_reader::File& file, const Grid& snap,
                                         FileSystem& files, TriangleSource& scene, uint64_t seed,
                                         const std::string& scratch_path, unsigned threads,
                                         MemoryBudget& budget, Progress& progress,
                                         const CancelToken& cancel, const Cutouts* cutouts) {
  const AttributeSet attributes = attributes_of(file);
  const ColorGrid grid = sampled_grid(file);
  std::vector<SampledRegion> regions = draw_regions(file, grid, seed);
  MemoryCharge charge(budget, 0, "surfaces of sampled regions");
  find_surfaces(scene, snap, grid, regions, charge, progress, cancel);
  SceneMaterials materials = scene.materials();
  materials.name_unlisted();
  if (attributes.have_names()) compare_materials(file, materials.names);
  if (cutouts) materials = with_separate_images(std::move(materials), *cutouts);
  if (!attributes.use_images()) materials.drop_images();
  progress.begin_stage("images", materials.images.size(), "images");
  const auto textures = TextureSet::prepare(files, materials, scratch_path, threads, budget,
                                            progress, cancel, cutouts);
  progress.end_stage();

  const MemoryCharge baking(budget, RegionBaker<TextureReader>::kMaxBytes + kCellsBytes,
                            "baking colors");
  MemoryCharge values_charge(budget, 0, "normals and materials of a sampled region");
  const auto reader = textures->open(budget.available() / 2);
  RegionBaker<TextureReader> baker(grid, textures->materials(), *reader, attributes, cutouts);
  std::vector<ColoredCell> cells;
  std::vector<CellValues> values;
  ColorSampleReport report;
  const RegionComparison comparison(file, grid, cells, values);
  for (const SampledRegion& region : regions) {
    cancel.check();
    baker.begin(region.cube);
    baker.add(region.surfaces, [&](uint64_t bytes) {
      if (bytes > values_charge.bytes() && !values_charge.try_resize(bytes))
        throw Error(ErrorCode::kOutOfMemory,
                    "out of memory: the normals and materials of a sampled region need " +
                        size_text(bytes) + ": expected more memory (" + option_text("memory") +
                        ")");
      return true;
    });
    baker.finish(cells, values);
    bool is_equal = true;
    for (const Attribute attribute : attributes.list())
      is_equal &= comparison.compare(region, attribute);
    ++report.regions;
    report.equal += is_equal;
    report.cells += cells.size();
  }
  return report;
}

}  // namespace voxdag::query
