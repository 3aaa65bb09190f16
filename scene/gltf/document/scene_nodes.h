// The nodes that a document draws: the scene's nodes and their descendants, without hidden ones.
#pragma once

#include "scene/gltf/document/document.h"

namespace voxdag::gltf {

// Links the nodes to their parents and sets the roots of the scene to draw. Afterwards the nodes
// that can be reached from the roots form trees, each drawn node is reached once, and
// `document.above_roots` has the transforms of roots that have a parent.
//
// A node that the scene lists twice, or together with an ancestor, is drawn once, with a warning. A
// listed node with a parent keeps the transforms of all its ancestors. Throws Error{kInvalidInput}
// for a cycle, for a node that does not exist, and for a drawn node that has two parents.
void link_scene(Document& document);

}  // namespace voxdag::gltf
