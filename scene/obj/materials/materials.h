// The materials of an OBJ file: the materials of its libraries, and white ones for names that no
// library has.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/growing_charge.h"
#include "scene/obj/file/obj_file.h"
#include "scene/triangle_source.h"

namespace voxdag::obj {

struct ObjMaterials {
  // The appearance of faces with one of the names in ObjFile::materials().
  struct Use {
    uint32_t material = 0;  // index into SceneMaterials::materials
    // True if the material has an image. Only then are the members below used. `without_image` is
    // the index of the same material without the image, for triangles without texture coordinates.
    // `scale` and `offset` transform the texture coordinates (ImageMap).
    bool has_image = false;
    uint32_t without_image = 0;
    std::array<double, 2> scale{1, 1}, offset{0, 0};
  };

  SceneMaterials scene;
  std::vector<Use> uses;          // one for each of ObjFile::materials()
  std::vector<SourceFile> files;  // the libraries
  GrowingCharge charge;
};

// Reads the libraries of the file, and opens the images of the materials that faces use. A file
// that cannot be opened gives a warning.
ObjMaterials read_materials(FileSystem& files, const ObjFile& obj, MemoryBudget& budget);

}  // namespace voxdag::obj
