// The checks of a document that need all of it.
#pragma once

#include "core/scene/gltf/document/document.h"

namespace voxdag::gltf {

// Establishes the invariants of Document, except that buffers are as long as they claim: nodes,
// scenes, meshes, skins, instancing and accessors are checked. Throws Error{kInvalidInput} naming
// the node, mesh and primitive, skin or accessor that breaks one.
void check_document(Document& document);

}  // namespace voxdag::gltf
