// Reads text files with points: columns, lines and rows. The target gives every input the name
// scene.csv, so that it is read as points whatever its bytes are.
#include "tests/fuzz/support/scene_triangles.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxdag::fuzz::check_scene(std::string(reinterpret_cast<const char*>(data), size), "scene.csv");
  return 0;
}
