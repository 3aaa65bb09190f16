#include "scene/generate/generate.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "scene/generate/glb_layout.h"
#include "scene/generate/glb_writer.h"
#include "scene/generate/scene_builder.h"

namespace voxdag {
namespace {

constexpr SceneKindInfo kKinds[] = {
    {SceneKind::kCity, "city", "streets, houses with rotated roofs, windows, trees", 400'000,
     make_city, kCityMaterials},
    {SceneKind::kMenger, "menger", "Menger's sponge on the integer lattice", 0, make_menger, {}},
    {SceneKind::kTerrain, "terrain", "a fractal heightfield", 1'000'000, make_terrain, {}},
    {SceneKind::kSoup,
     "soup",
     "random triangles, slivers and degenerate ones among them",
     100'000,
     make_soup,
     {}},
    {SceneKind::kSpheres, "spheres", "spheres of many sizes", 500'000, make_spheres, {}},
};

constexpr const char* kGenerator = "voxdag generate ";
constexpr uint32_t kMaxMengerLevel = 5;
// Bytes per triangle of a terrain. No other kind of scene needs fewer.
constexpr uint64_t kMinBytesPerTriangle = 12;

// Refuses sizes that are obviously too large, before the scene is generated. GlbLayout counts the
// bytes of all other scenes, and refuses the ones that are too large.
void check_size(const GenerateOptions& options) {
  const bool is_menger = options.kind == SceneKind::kMenger;
  const bool fits =
      is_menger ? options.level <= kMaxMengerLevel
                : options.instances || options.triangles <= kMaxGlbBytes / kMinBytesPerTriangle;
  if (!fits)
    throw Error(ErrorCode::kLimit,
                "the limit of a .glb is 4 294 967 295 bytes: expected " +
                    (is_menger ? "a level of at most " + std::to_string(kMaxMengerLevel) +
                                     ", not " + std::to_string(options.level)
                               : "at most " + std::to_string(kMaxGlbBytes / kMinBytesPerTriangle) +
                                     " triangles, not " + std::to_string(options.triangles)));
}

void check(const GenerateOptions& options) {
  const std::string name = scene_kind(options.kind).name;
  const bool has_parts = options.kind == SceneKind::kCity || options.kind == SceneKind::kSpheres;
  if (options.instances && !has_parts)
    throw Error(ErrorCode::kInvalidInput,
                "a scene of the kind " + name + " has no repeated parts, so " +
                    option_text("instances") +
                    " is not possible: expected the kind city or spheres");
  if (options.colors && scene_kind(options.kind).materials.empty())
    throw Error(ErrorCode::kInvalidInput,
                "a scene of the kind " + name +
                    " cannot have colors: expected the kind city, or no " + option_text("colors"));
  if (options.colors && options.instances)
    throw Error(ErrorCode::kInvalidInput, option_text("colors") + " and " +
                                              option_text("instances") +
                                              " were both given, but all instances of a part would "
                                              "have the same colors: expected only one of the two");
  if (options.kind == SceneKind::kMenger && options.triangles != 0)
    throw Error(ErrorCode::kInvalidInput,
                "menger has no number of triangles, but " + option_text("triangles") + " is " +
                    std::to_string(options.triangles) + ": expected " + option_text("level"));
  check_size(options);
}

void make(const GenerateOptions& options, BlockSink& sink) {
  SceneBuilder scene(sink, options.instances, options.colors);
  scene_kind(options.kind).make(options, scene);
  scene.finish();
}

}  // namespace

std::span<const SceneKindInfo> scene_kinds() { return kKinds; }

const SceneKindInfo& scene_kind(std::string_view name) {
  std::string names;
  for (const SceneKindInfo& info : kKinds) {
    if (info.name == name) return info;
    names += (names.empty() ? "" : ", ") + std::string(info.name);
  }
  throw Error(ErrorCode::kInvalidInput, "no generated scene is called \"" + std::string(name) +
                                            "\": expected one of " + names);
}

const SceneKindInfo& scene_kind(SceneKind kind) { return kKinds[static_cast<size_t>(kind)]; }

GenerateReport generate_scene(FileSystem& files, const std::string& path,
                              const GenerateOptions& given, Progress& progress,
                              const CancelToken& cancel) {
  check(given);
  GenerateOptions options = given;
  const SceneKindInfo& info = scene_kind(options.kind);
  if (options.triangles == 0) options.triangles = info.default_triangles;

  GlbLayout layout(progress, cancel);
  progress.begin_stage("count", options.triangles, "triangles");
  make(options, layout);
  progress.end_stage();

  progress.begin_stage("write", layout.stored_triangles(), "triangles");
  const std::string generator = std::string(kGenerator) + info.name;
  GlbWriter writer(files, path,
                   layout.json_text(generator, options.colors ? info.materials
                                                              : std::span<const SceneMaterial>()),
                   layout.bin_bytes(), progress, cancel);
  make(options, writer);
  const uint64_t bytes = writer.finish();
  progress.end_stage();
  return {layout.triangles(), layout.stored_triangles(), layout.instance_count(), bytes};
}

bool is_generated_scene(const ReadableFile& file) { return is_glb_of(file, kGenerator); }

}  // namespace voxdag
