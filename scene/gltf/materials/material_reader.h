// Converts a glTF material to a Material, and finds its base color texture.
#pragma once

#include <string>

#include "core/color/surface.h"
#include "scene/gltf/document/tinygltf_model.h"
#include "scene/gltf/materials/texture_transform.h"

namespace voxdag::gltf {

struct MaterialSource {
  Material material;  // the image is in the next member
  int image = -1;     // index in the model
  int texcoord = 0;   // the n of TEXCOORD_n
  TextureTransform transform;
  std::string problem;  // why its texture cannot be read; "" if it can or has none
};

// Reads material `index` of the model. If it has KHR_materials_pbrSpecularGlossiness, uses this
// instead of metallic-roughness. Ignores members of a wrong type.
MaterialSource read_material(const tinygltf::Model& model, int index);

}  // namespace voxdag::gltf
