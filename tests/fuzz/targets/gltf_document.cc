// Scene files: containers, JSON, the checks of a document, and the triangles of those that pass.
#include <string>

#include "core/scene/triangle_source.h"
#include "tests/fuzz/targets/fuzz_target.h"
#include "tests/unit/io/memory_files.h"

namespace voxdag {
namespace {

// A few bytes can declare any number of instances; drawing them tests nothing more.
constexpr uint64_t kMaxTriangles = 2000;
constexpr uint64_t kBudgetBytes = uint64_t{16} << 20;

}  // namespace
}  // namespace voxdag

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  test::MemoryFiles files;
  files.contents["scene"] = std::string(reinterpret_cast<const char*>(data), size);
  MemoryBudget budget(kBudgetBytes);
  CancelToken cancel;
  try {
    const auto scene = open_scene(files, {"scene"}, {.skip_invalid = true}, budget, cancel);
    if (scene->declared_triangles() > kMaxTriangles) return 0;
    uint64_t visited = 0;
    scene->for_each_batch([&](auto batch) { visited += batch.size(); });
    fuzz::require(visited <= scene->declared_triangles(), "no triangle is visited twice");
    uint64_t again = 0;
    const auto cursor = scene->open(2);
    for (uint64_t i = 0; i < scene->declared_triangles(); ++i)
      cursor->read(i, 1, [&](auto batch) { again += batch.size(); });
    fuzz::require(again == visited, "each triangle can be read alone");
  } catch (const Error& error) {
    fuzz::require(!error.message().empty(), "an error has a message");
  }
  return 0;
}
