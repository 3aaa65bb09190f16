#include "scheduler/stages/attributes/color_stage.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/color/cell_values.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"
#include "core/format/color/attribute_section_writer.h"
#include "core/format/color/color_layout.h"
#include "core/format/global/global_layout.h"
#include "core/geometry/morton.h"
#include "scene/formats/formats.h"
#include "scene/textures/find_cutouts.h"
#include "scene/textures/texture_set.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/attributes/bin_surfaces.h"
#include "scheduler/stages/attributes/color_keys.h"
#include "scheduler/stages/attributes/color_store.h"
#include "scheduler/stages/attributes/cube_baker.h"
#include "scheduler/stages/attributes/region_record.h"
#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

// Maximum level of the cubes that have bins. Level 4 has 16^3 cubes.
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

// Returns the number of cells with attributes on the finest level of a valid global file. All
// sections of the file have the same cells.
uint64_t count_finest_cells(const ReadableFile& file) {
  namespace layout = global_layout;
  if (number_at<uint64_t>(file, layout::kAttributeCountAt) == 0) return 0;
  return number_at<uint64_t>(file, layout::kAttributesAt + layout::kAttributeFinestCellsAt);
}

// Throws Error{kLimit} for a list of material names that readers of the file would refuse.
void check_list(std::span<const std::string> materials) {
  const uint64_t bytes = list_bytes(materials) + 2 * color_layout::kUnitBytes;
  if (materials.size() > color_layout::kMaxMaterials || bytes > color_layout::kMaxNamesBytes)
    throw Error(ErrorCode::kLimit, "the scene has " + std::to_string(materials.size()) +
                                       " materials, with names of " + size_text(bytes) +
                                       ": expected up to " +
                                       std::to_string(color_layout::kMaxMaterials) + " and " +
                                       size_text(color_layout::kMaxNamesBytes) + "; leave out " +
                                       option_text("attributes", "material"));
}

// A thread's objects for baking cubes, and its result for the current cube.
struct BakeWorker {
  std::unique_ptr<TextureReader> textures;
  std::optional<CubeBaker> baker;
  CubeBaker::Records records;  // for each attribute, the last part of the cube's records
  bool is_baked = false;       // baked in this run; otherwise its records are in the ColorStore
};

// Adds the regions in `records` to a section. `records` is an artifact (color_store.h) or a part of
// an artifact. Returns the number of cells of these regions on the finest level.
uint64_t add_regions(const ColorStore& artifacts, std::span<const std::byte> records,
                     AttributeSectionWriter& section) {
  RegionRecords regions(artifacts.path(), records);
  uint64_t cells = 0;
  while (const auto region = regions.next()) {
    section.add_region(*region);
    cells += region->counts[0];
  }
  return cells;
}

}  // namespace

struct ColorStage::State {
  const ColorSource source;
  const StageContext context;
  const ColorGrid grid;
  const std::vector<Cube> cubes;
  SceneMaterials materials;
  std::optional<Cutouts> cutouts_found;
  std::vector<StoredAttribute> attributes;
  std::vector<std::string> images;  // digests of the images
  bool have_problems = false;       // a warning explains why materials have no colors
  // Set after the surfaces are read:
  std::optional<MemoryBudget> share;
  std::optional<RecordStore> store;
  BinnedSurfaces surfaces;
  template <class T>
  using ByAttributeAndCube = std::vector<std::vector<T>>;
  ByAttributeAndCube<Checksum128> keys;
  // For each attribute and cube, the places of the records' parts in the ColorStore.
  ByAttributeAndCube<std::vector<ColorStore::Place>> parts;

  State(const ColorSource& s, const StageContext& c)
      : source(s),
        context(c),
        grid{s.grid.levels, levels_of_resolution(s.options.color_resolution)},
        cubes(bins_of(grid)) {}

  void open();
  void find_cutouts();
  // The cutouts that the build leaves out, or null.
  const Cutouts* cutouts() const { return cutouts_found ? &*cutouts_found : nullptr; }
  void read_surfaces();
  void warn_of_white() const;
  std::unique_ptr<TextureSet> decode_images(const ColorStore& artifacts);
  bool is_stored(const ColorStore& artifacts, size_t cube) const;
  void store_parts(ColorStore& artifacts, size_t cube, const CubeBaker::Records& records,
                   bool is_last_batch);
  void bake(ColorStore& artifacts, TextureSet& textures, GlobalFileWriter& out,
            ColorReport& report);
  void add_stored(const ColorStore& artifacts, size_t attribute, GlobalFileWriter& out,
                  const ColorReport& report);
};

bool ColorStage::State::is_stored(const ColorStore& artifacts, size_t cube) const {
  return std::ranges::all_of(
      keys, [&](const auto& of_attribute) { return artifacts.has(of_attribute[cube]); });
}

void ColorStage::State::open() {
  const BuildContext& build = context.build;
  materials = source.scene.open().materials();
  materials.name_unlisted();
  const AttributeSet& wanted = source.options.attributes;
  for (const Attribute attribute : wanted.list())
    attributes.push_back({attribute, value_bytes(attribute, materials.names.size())});
  if (wanted.have_names()) check_list(materials.names);
  find_cutouts();
  if (!wanted.use_images()) materials.drop_images();
  const WarningList warnings = std::exchange(materials.warnings, {});
  have_problems = !warnings.list().empty();
  for (const Warning& warning : warnings.list()) build.progress.warn_of_input(warning);
  images = image_digests(build.files, materials.images, context.threads, build.cancel);
}

void ColorStage::State::find_cutouts() {
  if (source.options.cutouts != CutoutRule::kSkip || !may_have_cutouts(materials)) return;
  WarningList reported_by_decode_images;
  cutouts_found.emplace(voxdag::find_cutouts(context.build.files, materials, context.threads,
                                             context.budget, context.build.cancel,
                                             reported_by_decode_images));
  materials = with_separate_images(std::move(materials), *cutouts_found);
}

void ColorStage::State::read_surfaces() {
  if (store) return;
  share.emplace(context.budget.available() / 3, &context.budget);
  store.emplace(context.build.files, source.work_folder + "/surfaces.vdspill", *share, "surfaces");
  const std::vector<Checksum128> looks =
      look_digests(materials.materials, images, source.options.attributes, cutouts());
  const SurfaceBinning binning{
      .grid = source.grid,
      .materials = materials.materials,
      .looks = looks,
      .cubes = cubes,
      .cutouts = cutouts(),
      .record_bytes = triangle_record_bytes(source.options.bounds.has_value()),
      .digest = source.digest,
      .buffer_bytes = MemoryPlan::divide(context.budget.limit()).partition_buffer_bytes};
  surfaces = bin_surfaces(source.scene.open(), binning, *store, context);
  source.scene.close();
  trim_heap();
  warn_of_white();
  for (const StoredAttribute& attribute : attributes)
    for (auto& of_attribute = keys.emplace_back(); of_attribute.size() < cubes.size();) {
      const size_t i = of_attribute.size();
      of_attribute.push_back(attribute_key(attribute, grid, cubes[i], surfaces.contents[i]));
    }
  parts.resize(attributes.size(), std::vector<std::vector<ColorStore::Place>>(cubes.size()));
}

// Warns if the user asks for the colors of a scene that has none.
void ColorStage::State::warn_of_white() const {
  const bool is_wanted = source.options.attributes.has(Attribute::kColor);
  const bool is_empty = std::ranges::all_of(
      surfaces.contents, [](const BinContent& content) { return content.surfaces == 0; });
  if (!is_wanted || is_empty || have_problems || surfaces.have_colors) return;
  context.build.progress.warn_of_input(
      {"no-colors", source.options.scenes.front(),
       "the scene has no colors: its materials and vertices are white, without images. So all "
       "voxels are white; leave out " +
           option_text("color")});
}

// Decodes the images that are needed to bake the cubes whose records are not stored.
std::unique_ptr<TextureSet> ColorStage::State::decode_images(const ColorStore& artifacts) {
  ImageClasses needed;
  for (size_t i = 0; i < cubes.size(); ++i)
    if (!is_stored(artifacts, i)) needed |= surfaces.contents[i].images;
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
    auto textures = TextureSet::prepare(build.files, shown, source.work_folder + "/images.vdspill",
                                        context.threads, context.budget, build.progress,
                                        build.cancel, cutouts());
    build.progress.end_stage();
    return textures;
  };
  try {
    return prepare();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
  }
  // The images did not fit in memory. Moves the surfaces to their spill file and tries again.
  store->move_to_file(surfaces.bins);
  trim_heap();
  return prepare();
}

void ColorStage::State::store_parts(ColorStore& artifacts, size_t cube,
                                    const CubeBaker::Records& records, bool is_last_batch) {
  for (size_t i = 0; i < attributes.size(); ++i) {
    std::vector<ColorStore::Place>& stored = parts[i][cube];
    stored.push_back(artifacts.add(keys[i][cube], stored.size(), is_last_batch, records[i]));
  }
}

// Bakes all attributes of the cubes whose records are not stored, and adds the first attribute's
// section to `out`.
void ColorStage::State::bake(ColorStore& artifacts, TextureSet& textures, GlobalFileWriter& out,
                             ColorReport& report) {
  const BuildContext& build = context.build;
  const auto memory =
      ColorMemory::divide(context.budget.available(), context.threads, source.options.attributes);
  std::vector<BakeWorker> workers(memory.workers);
  for (BakeWorker& worker : workers) worker.records.resize(attributes.size());
  AttributeSectionWriter section(out, attributes[0].kind, grid.color_levels, materials.names,
                                 context.budget);
  build.progress.begin_stage("color", report.cubes, "cubes");
  build.progress.resume_at(report.cubes_reused);
  std::vector<std::byte> part;
  parallel_for_in_order(
      memory.workers, cubes.size(),
      [&](unsigned number, size_t item) {
        BakeWorker& worker = workers[number];
        for (auto& records : worker.records) records.clear();
        worker.is_baked = false;
        if (surfaces.contents[item].surfaces == 0) return;
        if (is_stored(artifacts, item)) {
          for (size_t i = 0; i < attributes.size(); ++i)
            parts[i][item] = artifacts.parts(keys[i][item]);
          return;
        }
        if (!worker.baker) {
          worker.textures = textures.open(memory.texture_bytes);
          worker.baker.emplace(grid, attributes, textures.materials(), *worker.textures, *store,
                               memory.region_bytes, memory.surface_bytes, context.budget,
                               build.cancel, cutouts());
        }
        worker.baker->bake(cubes[item], surfaces.bins[item], worker.records,
                           [&](CubeBaker::Records& records) {
                             store_parts(artifacts, item, records, false);
                             for (auto& of_attribute : records) of_attribute.clear();
                           });
        store_parts(artifacts, item, worker.records, true);
        worker.is_baked = true;
      },
      [&](unsigned number, size_t item) {
        build.cancel.check();
        const BakeWorker& worker = workers[number];
        // If the cube was baked in this run, its last part is still in memory.
        std::span<const ColorStore::Place> stored = parts[0][item];
        if (worker.is_baked) stored = stored.first(stored.size() - 1);
        for (const ColorStore::Place& place : stored) {
          artifacts.read(place, part);
          report.cells += add_regions(artifacts, part, section);
        }
        report.cells += add_regions(artifacts, worker.records[0], section);
        if (worker.is_baked) build.progress.advance(1);
      });
  build.progress.end_stage();
  if (report.cells > 0) section.finish();
}

// Adds the section of an attribute other than the first one. The first attribute's section is
// written while cubes are baked. Sections are contiguous in the output, so the records of the other
// attributes wait in the work folder until the first section is complete. This function reads these
// records.
void ColorStage::State::add_stored(const ColorStore& artifacts, size_t attribute,
                                   GlobalFileWriter& out, const ColorReport& report) {
  const BuildContext& build = context.build;
  const Attribute kind = attributes[attribute].kind;
  AttributeSectionWriter section(out, kind, grid.color_levels, materials.names, context.budget);
  build.progress.begin_stage(name_of(kind), report.cubes, "cubes");
  std::vector<std::byte> part;
  for (size_t item = 0; item < cubes.size(); ++item) {
    if (surfaces.contents[item].surfaces == 0) continue;
    for (const ColorStore::Place& place : parts[attribute][item]) {
      build.cancel.check();
      artifacts.read(place, part);
      add_regions(artifacts, part, section);
    }
    build.progress.advance(1);
  }
  build.progress.end_stage();
  section.finish();
}

ColorStage::ColorStage(const ColorSource& source, const StageContext& context)
    : state_(std::make_unique<State>(source, context)) {
  state_->open();
}

ColorStage::~ColorStage() = default;

std::string ColorStage::digest() {
  state_->read_surfaces();
  Sha256 hash;
  for (const auto& keys : state_->keys) hash.add(std::as_bytes(std::span(keys)));
  if (state_->source.options.attributes.have_names())
    for (const std::string& name : state_->materials.names) {
      const uint64_t size = name.size();
      hash.add(std::as_bytes(std::span(&size, 1)));
      hash.add(std::as_bytes(std::span(name)));
    }
  return hash.finish();
}

std::string ColorStage::digest_of(FileSystem& files, const std::string& output,
                                  std::optional<ColorReport>& report) {
  std::string of_keys = digest();
  report.emplace();
  report->cells = count_finest_cells(*files.open_read(output));
  if (report->cells == 0) return of_keys;
  report->resolution = uint64_t{1} << state_->grid.color_levels;
  report->images = state_->materials.images.size();
  for (const BinContent& content : state_->surfaces.contents) report->cubes += content.surfaces > 0;
  report->cubes_reused = report->cubes;
  return of_keys;
}

ColorReport ColorStage::add_to(GlobalFileWriter& out) {
  if (out.progress().levels.empty()) return {};
  const StageContext& context = state_->context;
  state_->read_surfaces();
  ColorStore artifacts(context.build.files, state_->source.artifact_path,
                       state_->source.checkpoint_interval_s, context.build.progress,
                       context.build.cancel);
  std::vector<Checksum128> all_keys;
  for (const auto& keys : state_->keys) all_keys.insert(all_keys.end(), keys.begin(), keys.end());
  artifacts.keep_only(all_keys, context.build.cancel);
  ColorReport report;
  report.resolution = uint64_t{1} << state_->grid.color_levels;
  for (size_t i = 0; i < state_->cubes.size(); ++i) {
    if (state_->surfaces.contents[i].surfaces == 0) continue;
    ++report.cubes;
    if (!state_->is_stored(artifacts, i)) continue;
    ++report.cubes_reused;
    state_->store->clear(state_->surfaces.bins[i]);
  }
  const auto textures = state_->decode_images(artifacts);
  state_->bake(artifacts, *textures, out, report);
  for (size_t i = 1; i < state_->attributes.size() && report.cells > 0; ++i)
    state_->add_stored(artifacts, i, out, report);
  report.images = state_->materials.images.size();
  report.image_bytes = textures->bytes();
  report.spill_bytes = state_->store->file_bytes();
  return report;
}

}  // namespace voxdag
