#include "scheduler/color/color_stage.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/parallel_for.h"
#include "core/base/process_limits.h"
#include "core/format/color/color_section_writer.h"
#include "core/geometry/morton.h"
#include "core/scene/textures/texture_set.h"
#include "scheduler/color/bin_surfaces.h"
#include "scheduler/color/cube_baker.h"
#include "scheduler/memory_plan.h"
#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

// Bins are cubes of this level at most: 16^3 of them.
constexpr uint32_t kMaxBinLevel = 4;

std::vector<Cube> bins_of(const ColorGrid& grid) {
  const uint32_t level = std::min(grid.region_level(), kMaxBinLevel);
  std::vector<Cube> cubes(size_t{1} << 3 * level);
  for (size_t i = 0; i < cubes.size(); ++i) {
    cubes[i].level = level;
    morton_decode(i, cubes[i].position[0], cubes[i].position[1], cubes[i].position[2]);
  }
  return cubes;
}

// What bakes, and what one cube became.
struct BakeWorker {
  std::unique_ptr<TextureReader> textures;
  std::optional<CubeBaker> baker;
  std::vector<EncodedRegion> regions;
};

ColorReport bake(const ColorGrid& grid, TextureSet& textures, std::span<const Cube> cubes,
                 std::vector<SurfaceStore::Bin>& bins, SurfaceStore& store, GlobalFileWriter& out,
                 const StageContext& context) {
  const auto memory = ColorMemory::divide(context.budget.available(), context.threads);
  std::vector<BakeWorker> workers(memory.workers);
  ColorSectionWriter section(out, grid.color_levels, context.budget);
  ColorReport report;
  report.resolution = uint64_t{1} << grid.color_levels;
  context.build.progress.begin_stage("color", cubes.size(), "cubes");
  parallel_for_in_order(
      memory.workers, cubes.size(),
      [&](unsigned number, size_t item) {
        BakeWorker& worker = workers[number];
        worker.regions.clear();
        if (bins[item].surfaces == 0) return;
        if (!worker.baker) {
          worker.textures = textures.open(memory.texture_bytes);
          worker.baker.emplace(grid, textures.materials(), *worker.textures, store,
                               memory.surface_bytes, context.budget, context.build.cancel);
        }
        worker.baker->bake(cubes[item], bins[item], worker.regions);
      },
      [&](unsigned number, size_t) {
        context.build.cancel.check();
        for (const EncodedRegion& region : workers[number].regions) {
          section.add_region(region);
          report.cells += region.counts[0];
        }
        workers[number].regions.clear();
        context.build.progress.advance(1);
      });
  context.build.progress.end_stage();
  if (report.cells > 0) section.finish();
  return report;
}

}  // namespace

ColorReport add_colors(const ColorSource& source, GlobalFileWriter& out,
                       const StageContext& context) {
  if (out.progress().levels.empty()) return {};
  const GeometryOptions& options = source.options;
  const ColorGrid grid{source.grid.levels, levels_of_resolution(options.color_resolution)};
  const auto scene = open_scene(context.build.files, options.scenes,
                                {options.skip_invalid, source.work_folder + "/decoded.vdspill"},
                                context.budget, context.build.cancel);
  const SceneMaterials materials = scene->materials();
  for (const std::string& warning : materials.warnings) context.build.progress.warn(warning);
  context.build.progress.begin_stage("images", materials.images.size(), "images");
  const auto textures = TextureSet::prepare(
      context.build.files, materials, source.work_folder + "/images.vdspill", context.threads,
      context.budget, context.build.progress, context.build.cancel);
  context.build.progress.end_stage();

  MemoryBudget share(context.budget.available() / 3, &context.budget);
  SurfaceStore store(context.build.files, source.work_folder + "/surfaces.vdspill", share);
  const std::vector<Cube> cubes = bins_of(grid);
  const SurfaceBinning binning{
      .grid = source.grid,
      .materials = textures->materials(),
      .cubes = cubes,
      .record_bytes = triangle_record_bytes(options.bounds.has_value()),
      .digest = source.digest,
      .buffer_bytes = MemoryPlan::divide(context.budget.limit()).partition_buffer_bytes};
  std::vector<SurfaceStore::Bin> bins = bin_surfaces(*scene, binning, store, context);
  trim_heap();
  ColorReport report = bake(grid, *textures, cubes, bins, store, out, context);
  report.images = materials.images.size();
  report.image_bytes = textures->bytes();
  report.spill_bytes = store.file_bytes();
  return report;
}

}  // namespace voxdag
