// check_scene(): the checks that the fuzz targets of all scene formats run on their input.
#pragma once

#include <string>

#include "scene/formats/formats.h"
#include "scene/triangle_source.h"
#include "tests/fuzz/support/fuzz_target.h"
#include "tests/support/memory_files.h"

namespace voxdag::fuzz {

// Scenes that declare more triangles are not read: a few bytes can declare any number of instances,
// and reading more of them reaches no new code.
constexpr uint64_t kMaxTriangles = 2000;
constexpr uint64_t kSceneBudgetBytes = uint64_t{16} << 20;

// Opens `file` as a scene with the name `path`. If it is valid, reads its triangles in one pass and
// one by one, and their surfaces. `files` has the other files to which the scene may refer.
inline void check_scene(std::string file, const std::string& path = "scene",
                        test::MemoryFiles files = {}) {
  files.contents[path] = std::move(file);
  MemoryBudget budget(kSceneBudgetBytes);
  CancelToken cancel;
  try {
    const auto scene = open_scene(files, {path}, {.skip_invalid = true}, budget, cancel);
    if (scene->declared_triangles() > kMaxTriangles) return;
    uint64_t visited = 0;
    scene->for_each_batch([&](auto batch) { visited += batch.size(); });
    require(visited <= scene->declared_triangles(), "no triangle is visited twice");
    uint64_t again = 0;
    const auto cursor = scene->open(2);
    for (uint64_t i = 0; i < scene->declared_triangles(); ++i)
      cursor->read(i, 1, [&](auto batch) { again += batch.size(); });
    require(again == visited, "each triangle can be read alone");
    const auto materials = scene->materials();
    require(materials.materials.size() == scene->material_count(), "all materials are counted");
    cursor->read_surfaces(0, scene->declared_triangles(), [&](auto batch) {
      again -= batch.size();
      for (const SurfaceTriangle& triangle : batch)
        require(triangle.material < materials.materials.size(), "each material exists");
    });
    require(again == 0, "each triangle has a surface");
  } catch (const Error& error) {
    require(!error.message().empty(), "an error has a message");
  }
}

}  // namespace voxdag::fuzz
