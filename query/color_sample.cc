#include "query/color_sample.h"

#include <algorithm>
#include <random>
#include <vector>

#include "core/base/error.h"
#include "core/color/blocks/region.h"
#include "core/color/rule/bake_region.h"
#include "core/format/global/diff_colors.h"
#include "core/geometry/morton.h"
#include "core/scene/textures/texture_set.h"

namespace voxdag::query {
namespace {

using voxdag_reader::ColorRegion;
using voxdag_reader::ColorSection;
using voxdag_reader::ColorTier;

struct SampledRegion {
  ColorRegion stored;
  Cube cube;
  std::vector<FixedSurface> surfaces;  // that may touch it
};

std::vector<SampledRegion> draw_regions(const voxdag_reader::File& file, const ColorGrid& grid,
                                        uint64_t seed) {
  const ColorTier& tier = file.colors().tier(0);
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
    if (!ColorSection::region(tier, drawn[i], region.stored))
      file.broken_colors("a region is damaged");
    region.cube.level = grid.region_level();
    auto& [x, y, z] = region.cube.position;
    morton_decode(region.stored.morton, x, y, z);
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
    if (snap_triangle(snap, triangle.position, surface.position) != SnapResult::kInside) return;
    surface.corners = triangle.corners;
    surface.material = triangle.material;
    const CellBox box(surface.position, grid.levels, grid.region_level());
    for (SampledRegion& region : regions) {
      if (!may_touch(box, region.cube)) continue;
      bytes += 2 * sizeof(FixedSurface);  // vectors grow by halves
      if (bytes > charge.bytes() && !charge.try_resize(2 * bytes))
        throw Error(ErrorCode::kOutOfMemory,
                    "not enough memory for the triangles of the sampled color regions");
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

bool is_equal(const EncodedRegion& baked, const ColorRegion& stored) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(baked.blocks.data());
  return std::equal(baked.counts.begin(), baked.counts.end(), stored.counts) &&
         std::equal(bytes, bytes + baked.blocks.size(), stored.blocks);
}

// Of the colors of the finest cells, which are equally many.
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

}  // namespace

ColorSampleReport compare_sampled_colors(const voxdag_reader::File& file, const Grid& snap,
                                         FileSystem& files, TriangleSource& scene, uint64_t seed,
                                         const std::string& scratch_path, unsigned threads,
                                         MemoryBudget& budget, Progress& progress,
                                         const CancelToken& cancel) {
  const ColorGrid grid{file.grid_levels(), file.color_levels()};
  std::vector<SampledRegion> regions = draw_regions(file, grid, seed);
  MemoryCharge charge(budget, 0, "surfaces of sampled regions");
  find_surfaces(scene, snap, grid, regions, charge, progress, cancel);
  const SceneMaterials materials = scene.materials();
  progress.begin_stage("images", materials.images.size(), "images");
  const auto textures =
      TextureSet::prepare(files, materials, scratch_path, threads, budget, progress, cancel);
  progress.end_stage();

  const MemoryCharge baking(budget, RegionBaker<TextureReader>::kMaxBytes, "baking colors");
  const auto reader = textures->open(budget.available() / 2);
  RegionBaker<TextureReader> baker(grid, textures->materials(), *reader);
  std::vector<ColoredCell> cells;
  ColorSampleReport report;
  for (const SampledRegion& region : regions) {
    cancel.check();
    baker.bake(region.cube, region.surfaces, cells);
    EncodedRegion baked;
    if (!cells.empty())
      baked = encode_region(grid.color_levels - region.cube.level, region.stored.morton, cells);
    const bool is_same = is_equal(baked, region.stored);
    if (!is_same && (baked.counts[0] != region.stored.counts[0] ||
                     difference(baked, region.stored).psnr() < kMinSamplePsnr))
      throw Error(ErrorCode::kCorrupt,
                  file.path() + ": the colors of the region at color cell " +
                      place_of(region.cube, grid) + " are not those of the scene (" +
                      std::to_string(region.stored.counts[0]) + " cells in the file, " +
                      std::to_string(baked.counts[0]) + " in the scene)");
    ++report.regions;
    report.equal += is_same;
    report.cells += region.stored.counts[0];
  }
  return report;
}

}  // namespace voxdag::query
