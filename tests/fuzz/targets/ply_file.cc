// Reads PLY files: the header, the rows, and the triangles. The target adds the first line of a PLY
// file before every input.
#include "tests/fuzz/support/scene_triangles.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxdag::fuzz::check_scene("ply\n" + std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
