// Scenes generated from a seed. They can have any size, and are streamed to a .glb in a few MB of
// memory. They have the same bytes on every machine, because the generators use only integers,
// their own random numbers, and + - * / and sqrt of IEEE doubles, compiled without fused
// multiply-add. docs/examples/generate.md describes the kinds. Tests compare each kind with a
// stored digest.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/base/progress.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

enum class SceneKind { kCity, kMenger, kTerrain, kSoup, kSpheres };

class SceneBuilder;
struct GenerateOptions;

// A material of a scene with colors. Its base color is multiplied by the colors of the vertices.
struct SceneMaterial {
  const char* name;
  float base_color[3];  // linear
};

struct SceneKindInfo {
  SceneKind kind;
  const char* name;
  const char* summary;
  uint64_t default_triangles;  // 0 for menger, whose size is its level
  void (*make)(const GenerateOptions& options, SceneBuilder& scene);
  std::span<const SceneMaterial> materials;  // empty for a kind without colors
};
std::span<const SceneKindInfo> scene_kinds();
// Returns the kind with this name. Throws Error{kInvalidInput} with the list of names for any other
// name.
const SceneKindInfo& scene_kind(std::string_view name);
const SceneKindInfo& scene_kind(SceneKind kind);

struct GenerateOptions {
  SceneKind kind = SceneKind::kCity;
  uint64_t seed = 1;
  // The number of triangles: exact for soup, rounded down to a square for terrain, approximate for
  // city and spheres. 0: the kind's default.
  uint64_t triangles = 0;
  // menger only: number of subdivisions of the cube, 0 to 5.
  uint32_t level = 3;
  // city and spheres: repeated parts are stored once and placed by EXT_mesh_gpu_instancing.
  bool instances = false;
  // city only, without `instances`: adds materials and vertex colors. The triangles are the same as
  // without colors.
  bool colors = false;
};

struct GenerateReport {
  uint64_t triangles = 0;         // including every instance
  uint64_t stored_triangles = 0;  // triangles in the file
  uint64_t instances = 0;
  uint64_t bytes = 0;
};

// Writes the scene to `path` atomically. Generates the scene twice: first to count its elements,
// because a .glb begins with their description, then to write it. Throws Error: kInvalidInput for
// an option that the kind does not have, kLimit for a scene that does not fit in a .glb (4 GiB).
GenerateReport generate_scene(FileSystem& files, const std::string& path,
                              const GenerateOptions& options, Progress& progress,
                              const CancelToken& cancel);

// True if the file is a scene written by generate_scene(), or the beginning of one.
bool is_generated_scene(const ReadableFile& file);

}  // namespace voxdag
