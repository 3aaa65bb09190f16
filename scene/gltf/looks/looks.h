// What the primitives of a document look like: which material each has, and from which accessors
// its texture coordinates and colors are read.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/color/surface.h"
#include "scene/gltf/document/document.h"
#include "scene/gltf/looks/texture_transform.h"

namespace voxdag::gltf {

struct Looks {
  // Those of the file; then one for primitives without material, if there are any; then those of
  // the file without their image, for primitives that lack the texture coordinates. `image` is an
  // index into `images`.
  std::vector<Material> materials;
  std::vector<TextureTransform> transforms;  // of each material's texture coordinates
  std::vector<int> images;                   // of the model, those that materials use
  std::vector<std::string> warnings;         // the first few, and a line about the others
};

// Sets document.looks and the looks of its primitives. Call it once, after check_document(). What
// is wrong with looks is no error, but a warning.
void resolve_looks(Document& document);

}  // namespace voxdag::gltf
