// Checks the meshes and skins that the scene draws. All others may be broken.
#pragma once

#include "scene/gltf/document/document.h"

namespace voxdag::gltf {

// Marks the meshes that nodes of the scene draw. Checks these meshes and the nodes' skins and
// instances. Places compressed primitives. Throws Error{kInvalidInput}.
void check_drawn_meshes(Document& document);

}  // namespace voxdag::gltf
