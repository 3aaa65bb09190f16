// Reads glTF scenes, text or binary: the container, the JSON, the checks of the document, and the
// triangles of files that pass the checks.
#include "tests/fuzz/support/scene_triangles.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxdag::fuzz::check_scene(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
