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
  bool only_emits = false;  // the color is the emitted light, which vertex colors do not change
  std::string problem;      // why the texture cannot be read; "" for a readable or missing texture
  std::string sampler_problem;  // why the texture's sampler is not used; "" if it is used or absent
};

// Reads material `index` of the model. Uses KHR_materials_pbrSpecularGlossiness, if the material
// has it, instead of metallic-roughness. Ignores members of a wrong type, which material_members.h
// has reported.
MaterialSource read_material(const tinygltf::Model& model, int index);

}  // namespace voxdag::gltf
