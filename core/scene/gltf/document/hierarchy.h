// The node hierarchy of a document: the parents of nodes, and the roots of the scene to draw.
#pragma once

#include "core/scene/gltf/document/document.h"

namespace voxdag::gltf {

// Sets the parents. Throws Error{kInvalidInput} naming a node with two parents, or one that is its
// own ancestor.
void link_parents(Document& document);

// Sets the roots of the document: those of the default scene, else of the first scene, else all
// nodes that have no parent. Throws Error{kInvalidInput} for a scene that lists a node with a
// parent.
void choose_scene(Document& document);

}  // namespace voxdag::gltf
