// Reads OBJ files and their material libraries. The target uses every input twice: as the
// statements of an OBJ file after a few valid statements, and as the library of this file.
#include "tests/fuzz/support/scene_triangles.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  voxdag::test::MemoryFiles files;
  files.contents["./a.mtl"] = text;
  files.contents["./a.png"] = "no image";
  voxdag::fuzz::check_scene("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0 1 0 0\nvt 0 1\n" + text,
                            "scene", std::move(files));
  return 0;
}
