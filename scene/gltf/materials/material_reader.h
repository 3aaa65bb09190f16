// Converts a glTF material to a Material, and finds its base color texture.
#pragma once

#include <string>

#include "core/color/surface.h"
#include "scene/gltf/document/tinygltf_model.h"
#include "scene/gltf/materials/texture_transform.h"

namespace voxdag::gltf {

struct MaterialSource {
  Material material;  // without image
  int image = -1;     // of the model
  int texcoord = 0;   // the n of TEXCOORD_n
  TextureTransform transform;
  std::string problem;  // why its texture cannot be read, if it has one; "" otherwise
};

// Material `index` of the model. KHR_materials_pbrSpecularGlossiness, where there is one, is used
// instead of metallic-roughness. What is not of the type that it should be is ignored.
MaterialSource read_material(const tinygltf::Model& model, int index);

}  // namespace voxdag::gltf
