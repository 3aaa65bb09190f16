// Checks of references between elements of a document, made after all elements have been read.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/gltf/document/document.h"

namespace voxdag::gltf {

// Checks nodes, scenes, and the meshes, skins, instancing and accessors of the chosen scene.
// Afterwards the invariants of Document hold, except that buffers may be shorter than declared.
// Throws Error{kInvalidInput} with the node, mesh and primitive, skin or accessor that violates an
// invariant.
void check_document(Document& document);

// One use of an accessor: its name for messages, and the types that it requires.
struct AccessorUse {
  std::string where;                        // "mesh 0: primitive 2: POSITION"
  int components;                           // 3 for VEC3
  std::vector<int> types;                   // allowed component types
  std::vector<int> may_be_normalized = {};  // component types that may be normalized
};

// Checks that `index` is below `size`. `what` is the kind of the element: "child node".
void check_index(const Document& document, size_t size, int index, const std::string& where,
                 const char* what);
// If `index` is not -1, checks that this accessor exists and has a type that the use allows. Checks
// that the accessor's bytes are inside its view and inside the declared length of its buffer.
// Throws Error{kInvalidInput}.
void check_accessor(const Document& document, int index, const AccessorUse& use);
// Checks that an accessor has `count` elements. `index` must be -1 or an existing accessor.
void check_count(const Document& document, int index, uint64_t count, const std::string& where);
// Returns the buffers that a checked accessor is read from.
std::vector<int> buffers_of(const Document& document, const Accessor& accessor);

}  // namespace voxdag::gltf
