// The node hierarchy of a document: who is whose parent, and which scene is drawn.
#pragma once

#include "core/scene/gltf/document/document.h"

namespace voxdag::gltf {

// Sets the parents. Throws Error{kInvalidInput} naming a node with two parents, or one that is its
// own ancestor.
void link_parents(Document& document);

// Sets the roots: of the default scene, else of the first; of a document without scenes, all nodes
// that have no parent. Throws Error{kInvalidInput} for a scene that lists what is no root.
void choose_scene(Document& document);

}  // namespace voxdag::gltf
