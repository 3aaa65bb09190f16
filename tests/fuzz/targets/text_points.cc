// Text files with points: columns, lines and rows. The name of the file makes every text a file of
// points.
#include "tests/fuzz/targets/scene_triangles.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxdag::fuzz::check_scene(std::string(reinterpret_cast<const char*>(data), size), "scene.csv");
  return 0;
}
