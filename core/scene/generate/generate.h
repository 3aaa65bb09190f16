// Scenes made from a seed: any size, streamed to a .glb in a few MB of memory, the same bytes on
// every machine. That takes integers, + - * / and sqrt of IEEE doubles (compiled without fused
// multiply-add), own random numbers, and nothing of the mathematical library. docs/generate.md
// describes the kinds; the tests pin a digest of each, so a changed byte is a changed promise.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/base/cancel_token.h"
#include "core/base/progress.h"
#include "core/io/file_system.h"

namespace voxdag {

enum class SceneKind { kCity, kMenger, kTerrain, kSoup, kSpheres };

struct SceneKindInfo {
  SceneKind kind;
  const char* name;
  const char* summary;
  uint64_t default_triangles;  // 0 for the kind that is sized by its level
};
std::span<const SceneKindInfo> scene_kinds();
// Throws Error{kInvalidInput} listing the names there are.
const SceneKindInfo& scene_kind(std::string_view name);
const SceneKindInfo& scene_kind(SceneKind kind);

struct GenerateOptions {
  SceneKind kind = SceneKind::kCity;
  uint64_t seed = 1;
  // Triangles wanted: soup gives exactly these, terrain the largest square below, city and spheres
  // about as many. 0 is the kind's default.
  uint64_t triangles = 0;
  // menger only: how often the cube was cut, 0 to 5.
  uint32_t level = 3;
  // city and spheres: repeated parts are stored once and placed by EXT_mesh_gpu_instancing.
  bool instances = false;
};

struct GenerateReport {
  uint64_t triangles = 0;         // as a reader sees them, instances counted
  uint64_t stored_triangles = 0;  // as the file holds them
  uint64_t instances = 0;
  uint64_t bytes = 0;
};

// Writes the scene to `path`, whole or not at all. The scene is made twice: first to count it,
// since a .glb begins with its description, then to write it. Throws Error: kInvalidInput for an
// option that the kind does not have, kLimit for a scene that does not fit a .glb (4 GiB).
GenerateReport generate_scene(FileSystem& files, const std::string& path,
                              const GenerateOptions& options, Progress& progress,
                              const CancelToken& cancel);

}  // namespace voxdag
