// The nodes that a document draws: the scene's nodes and their descendants, without hidden ones.
#pragma once

#include "scene/gltf/document/document.h"

namespace voxdag::gltf {

// Links the nodes to their parents, and sets the roots of the scene to draw. Afterwards each drawn
// node can be reached from exactly one root, by one path. For each root that has a parent,
// `document.above_roots` then has the parent's global transform.
//
// A node that the scene lists twice, or together with an ancestor, is drawn once, with a warning. A
// listed node with a parent keeps the transforms of all its ancestors. Throws Error{kInvalidInput}
// for a cycle, for a node that does not exist, and for a drawn node that has two parents.
void link_scene(Document& document);

}  // namespace voxdag::gltf
