// A scene file as assimp reads it. Only scene/import includes assimp. Not thread-safe.
#pragma once

#include <assimp/scene.h>

#include <array>
#include <assimp/Importer.hpp>
#include <set>
#include <string>

#include "core/base/warning.h"

namespace voxdag {

class AssimpScene {
 public:
  // Throws Error{kInvalidInput} with assimp's message if assimp cannot read the file. May also
  // throw std::bad_alloc.
  explicit AssimpScene(const std::string& path);

  const std::string& path() const { return path_; }
  const aiScene& operator*() const { return *scene_; }
  const aiScene* operator->() const { return scene_; }
  // Returns the matrix, column by column, that converts the positions of the scene to the unit and
  // the axes of glTF: meters, y upward, z to the front.
  std::array<double, 16> to_gltf() const;
  // Returns warnings about the parts of the file that import_scene() does not write to the .glb.
  const WarningList& losses() const { return losses_; }
  // Returns the paths of all files that assimp has opened: the scene file, and files that it names,
  // such as the .mtl file of an .obj file. Images are not among them.
  const std::set<std::string>& opened() const { return opened_; }

 private:
  struct Axis {
    unsigned number;  // 0: x
    int sign;
  };

  void add_losses();
  [[noreturn]] void refuse_file();
  std::string extensions() const;
  double meters_per_unit() const;
  std::array<Axis, 3> axes() const;

  const std::string path_;
  std::set<std::string> opened_;
  Assimp::Importer importer_;
  const aiScene* scene_ = nullptr;
  WarningList losses_;
};

// Returns the name of a node, a mesh or a material.
inline std::string text_of(const aiString& name) { return {name.data, name.length}; }

}  // namespace voxdag
