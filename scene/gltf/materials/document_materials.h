// The materials of a document, and for each primitive the material and the accessors of its texture
// coordinates and colors.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/color/surface.h"
#include "scene/gltf/document/document.h"
#include "scene/gltf/materials/texture_transform.h"

namespace voxdag::gltf {

struct DocumentMaterials {
  // The file's materials in the file's order, then additional materials in the order of their first
  // use. There are two kinds of additional materials. Primitives that have no material share one
  // white material. If a primitive has no texture coordinates but its material has an image, the
  // primitive uses a copy of the material from which the image is removed. Material::image is an
  // index into `images`.
  std::vector<Material> materials;
  std::vector<TextureTransform> transforms;  // transform of each material's texture coordinates
  std::vector<int> images;                   // indices of used images in the model
  WarningList warnings;
};

// Sets document.materials and the surfaces of its primitives. Call it once, after check_document().
// Invalid materials and attributes give warnings, not errors.
void resolve_materials(Document& document);

}  // namespace voxdag::gltf
