// The common data of a PLY file's colors and textures: color scales, materials and texture files.
//
// A triangle is textured if the file names a texture that can be opened, and its face or its
// vertices have texture coordinates (the face's are preferred). Other triangles have the colors of
// their vertices or, if the vertices have none, of their face.
#pragma once

#include <cmath>
#include <cstdint>
#include <mutex>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/ply/color_scale.h"
#include "scene/ply/ply_file.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::ply {

class Surfaces {
 public:
  struct Values {
    ColorScale vertex_colors, face_colors;
    // Material 0 is white. Material i + 1 has image i, which is texture file i.
    SceneMaterials scene;
  };

  // All references must outlive this object.
  Surfaces(FileSystem& files, const PlyFile& ply, MemoryBudget& budget, const CancelToken& cancel)
      : files_(files), ply_(ply), budget_(budget), cancel_(cancel) {}

  // Returns the values. The first call reads the colors of the file, if their type does not
  // determine their range, and opens the texture files. Thread-safe.
  const Values& values();

  // Number of materials.
  uint32_t materials() const {
    return 1 + static_cast<uint32_t>(ply_.header().texture_files.size());
  }
  // True if `texture` is the position of a texture file that could be opened.
  static bool is_usable(const Values& values, size_t texture) {
    return texture < values.scene.images.size() && values.scene.images[texture].problem.empty();
  }
  // Returns the position of a texture in the list of texture files, from its number in a face.
  // Returns SIZE_MAX for a number that is no position.
  static size_t texture_of(double number) {
    const bool is_position = number >= 0 && number < 65536 && std::floor(number) == number;
    return is_position ? static_cast<size_t>(number) : SIZE_MAX;
  }
  // Returns the properties of faces that surfaces need. RequestedProperties::numbers has the
  // channels of the color and then, if the layout has it, the number of the texture.
  static RequestedProperties face_properties(const Layout& layout);

 private:
  // `place` is the part of the file that the warning is about; "" is the complete file.
  void warn(const char* code, const std::string& place, const std::string& message,
            uint64_t count = 1);
  void open_textures();
  void scan_vertices();
  void scan_faces();

  FileSystem& files_;
  const PlyFile& ply_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  std::mutex mutex_;
  bool is_ready_ = false;
  Values values_;
};

}  // namespace voxdag::ply
