#include "scheduler/color/color_stage.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/base/process_limits.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"
#include "core/format/color/color_section_writer.h"
#include "core/format/global/global_layout.h"
#include "core/geometry/morton.h"
#include "core/scene/textures/texture_set.h"
#include "scheduler/color/bin_surfaces.h"
#include "scheduler/color/color_keys.h"
#include "scheduler/color/color_store.h"
#include "scheduler/color/cube_baker.h"
#include "scheduler/color/region_record.h"
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

template <class T>
T number_at(const ReadableFile& file, uint64_t offset) {
  std::array<std::byte, sizeof(T)> bytes;
  file.read_at(offset, bytes);
  return ByteSource(bytes).get<T>();
}

// The colored cells of a sound global file, those of the finest level.
uint64_t count_finest_cells(const ReadableFile& file) {
  namespace layout = global_layout;
  // Colors come before attributes of other kinds.
  const uint64_t entry = layout::kAttributesAt;
  const bool has_colors =
      number_at<uint64_t>(file, layout::kAttributeCountAt) > 0 &&
      number_at<uint32_t>(file, entry + layout::kAttributeKindAt) == layout::kColorAttribute;
  return has_colors ? number_at<uint64_t>(file, entry + layout::kAttributeFinestCellsAt) : 0;
}

// What bakes, and what one cube became.
struct BakeWorker {
  std::unique_ptr<TextureReader> textures;
  std::optional<CubeBaker> baker;
  std::vector<std::byte> records;
  MemoryCharge stored;  // for the largest records that were read
};

}  // namespace

struct ColorStage::State {
  const ColorSource source;
  const StageContext context;
  const ColorGrid grid;
  const std::vector<Cube> cubes;
  std::unique_ptr<TriangleSource> scene;
  SceneMaterials materials;
  std::vector<std::string> images;  // their digests
  // Once the surfaces are read:
  std::optional<MemoryBudget> share;
  std::optional<SurfaceStore> store;
  BinnedSurfaces surfaces;
  std::vector<Checksum128> keys;

  State(const ColorSource& s, const StageContext& c)
      : source(s),
        context(c),
        grid{s.grid.levels, levels_of_resolution(s.options.color_resolution)},
        cubes(bins_of(grid)) {}

  void open();
  void read_surfaces();
  std::unique_ptr<TextureSet> decode_images(const ColorStore& artifacts);
  void bake(ColorStore& artifacts, TextureSet& textures, GlobalFileWriter& out,
            ColorReport& report);
};

void ColorStage::State::open() {
  const BuildContext& build = context.build;
  scene = open_scene(build.files, source.options.scenes,
                     {source.options.skip_invalid, source.work_folder + "/decoded.vdspill"},
                     context.budget, build.cancel);
  materials = scene->materials();
  for (const std::string& warning : std::exchange(materials.warnings, {}))
    build.progress.warn(warning);
  images = image_digests(build.files, materials.images, context.threads, build.cancel);
}

void ColorStage::State::read_surfaces() {
  if (store) return;
  share.emplace(context.budget.available() / 3, &context.budget);
  store.emplace(context.build.files, source.work_folder + "/surfaces.vdspill", *share);
  const std::vector<Checksum128> looks = look_digests(materials.materials, images);
  const SurfaceBinning binning{
      .grid = source.grid,
      .materials = materials.materials,
      .looks = looks,
      .cubes = cubes,
      .record_bytes = triangle_record_bytes(source.options.bounds.has_value()),
      .digest = source.digest,
      .buffer_bytes = MemoryPlan::divide(context.budget.limit()).partition_buffer_bytes};
  surfaces = bin_surfaces(*scene, binning, *store, context);
  scene.reset();
  trim_heap();
  for (size_t i = 0; i < cubes.size(); ++i)
    keys.push_back(color_key(grid, cubes[i], surfaces.contents[i]));
}

// Those that cubes show which are to be baked.
std::unique_ptr<TextureSet> ColorStage::State::decode_images(const ColorStore& artifacts) {
  ImageClasses needed;
  for (size_t i = 0; i < cubes.size(); ++i)
    if (!artifacts.has(keys[i])) needed |= surfaces.contents[i].images;
  uint64_t count = 0;
  for (size_t i = 0; i < materials.images.size(); ++i) count += needed.test(i % needed.size());
  SceneMaterials shown = materials;
  for (Material& material : shown.materials)
    if (material.image != Material::kNoImage && !needed.test(material.image % needed.size()))
      material.image = Material::kNoImage;
  const BuildContext& build = context.build;
  const auto prepare = [&] {
    build.progress.begin_stage("images", materials.images.size(), "images");
    build.progress.resume_at(materials.images.size() - count);
    auto textures =
        TextureSet::prepare(build.files, shown, source.work_folder + "/images.vdspill",
                            context.threads, context.budget, build.progress, build.cancel);
    build.progress.end_stage();
    return textures;
  };
  try {
    return prepare();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
  }
  // Large images may be decoded in the memory of the surfaces.
  store->move_to_file(surfaces.bins);
  trim_heap();
  return prepare();
}

void ColorStage::State::bake(ColorStore& artifacts, TextureSet& textures, GlobalFileWriter& out,
                             ColorReport& report) {
  const BuildContext& build = context.build;
  const auto memory = ColorMemory::divide(context.budget.available(), context.threads);
  std::vector<BakeWorker> workers(memory.workers);
  ColorSectionWriter section(out, grid.color_levels, context.budget);
  build.progress.begin_stage("color", report.cubes, "cubes");
  build.progress.resume_at(report.cubes_reused);
  parallel_for_in_order(
      memory.workers, cubes.size(),
      [&](unsigned number, size_t item) {
        BakeWorker& worker = workers[number];
        worker.records.clear();
        if (surfaces.contents[item].surfaces == 0) return;
        if (artifacts.has(keys[item])) {
          const uint64_t bytes = artifacts.bytes_of(keys[item]);
          if (bytes > worker.stored.bytes()) {
            worker.stored = {};
            worker.stored = MemoryCharge(context.budget, bytes, "stored colors of a cube");
          }
          return artifacts.read(keys[item], worker.records);
        }
        if (!worker.baker) {
          worker.textures = textures.open(memory.texture_bytes);
          worker.baker.emplace(grid, textures.materials(), *worker.textures, *store,
                               memory.surface_bytes, context.budget, build.cancel);
        }
        worker.baker->bake(cubes[item], surfaces.bins[item], worker.records);
        artifacts.add(keys[item], worker.records);
      },
      [&](unsigned number, size_t item) {
        build.cancel.check();
        RegionRecords records(workers[number].records);
        while (const auto region = records.next()) {
          section.add_region(*region);
          report.cells += region->counts[0];
        }
        if (surfaces.contents[item].surfaces > 0 && !artifacts.has(keys[item]))
          build.progress.advance(1);
      });
  build.progress.end_stage();
  if (report.cells > 0) section.finish();
}

ColorStage::ColorStage(const ColorSource& source, const StageContext& context)
    : state_(std::make_unique<State>(source, context)) {
  state_->open();
}

ColorStage::~ColorStage() = default;

std::string ColorStage::digest() {
  state_->read_surfaces();
  Sha256 hash;
  hash.add(std::as_bytes(std::span(state_->keys)));
  return hash.finish();
}

ColorReport ColorStage::report_of(const ReadableFile& result) {
  ColorReport report;
  report.cells = count_finest_cells(result);
  if (report.cells == 0) return report;
  state_->read_surfaces();
  report.resolution = uint64_t{1} << state_->grid.color_levels;
  report.images = state_->materials.images.size();
  for (const BinContent& content : state_->surfaces.contents) report.cubes += content.surfaces > 0;
  report.cubes_reused = report.cubes;
  return report;
}

ColorReport ColorStage::add_to(GlobalFileWriter& out) {
  if (out.progress().levels.empty()) return {};
  const StageContext& context = state_->context;
  state_->read_surfaces();
  ColorStore artifacts(context.build.files, state_->source.artifact_path,
                       state_->source.checkpoint_interval_s, context.build.progress,
                       context.build.cancel);
  ColorReport report;
  report.resolution = uint64_t{1} << state_->grid.color_levels;
  for (size_t i = 0; i < state_->cubes.size(); ++i) {
    if (state_->surfaces.contents[i].surfaces == 0) continue;
    ++report.cubes;
    if (!artifacts.has(state_->keys[i])) continue;
    ++report.cubes_reused;
    state_->store->clear(state_->surfaces.bins[i]);
  }
  const auto textures = state_->decode_images(artifacts);
  state_->bake(artifacts, *textures, out, report);
  report.images = state_->materials.images.size();
  report.image_bytes = textures->bytes();
  report.spill_bytes = state_->store->file_bytes();
  return report;
}

}  // namespace voxdag
