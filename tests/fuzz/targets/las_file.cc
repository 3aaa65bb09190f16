// Reads LAS files: the header and the records. The target adds the signature of a LAS file before
// every input.
#include "tests/fuzz/support/scene_triangles.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxdag::fuzz::check_scene("LASF" + std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
