// The checks of a document that need all of it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/gltf/document/document.h"

namespace voxdag::gltf {

// Establishes the invariants of Document, except that buffers are as long as they claim: nodes,
// scenes, meshes, skins, instancing and accessors are checked. Throws Error{kInvalidInput} naming
// the node, mesh and primitive, skin or accessor that breaks one.
void check_document(Document& document);

// How an accessor is used, which determines the type it must have.
struct AccessorUse {
  std::string where;  // "mesh 0: primitive 2: POSITION"
  int components;
  std::vector<int> types;
  std::vector<int> may_be_normalized = {};
};

// Checks that accessor `index`, unless it is -1, exists and has a type of the use, and that its
// bytes are inside its view and the length that its buffer claims. Throws Error{kInvalidInput}.
void check_accessor(const Document& document, int index, const AccessorUse& use);
// Checks that an accessor that exists, or -1, has `count` elements.
void check_count(const Document& document, int index, uint64_t count, const std::string& where);
// The buffers that a checked accessor is read from.
std::vector<int> buffers_of(const Document& document, const Accessor& accessor);

}  // namespace voxdag::gltf
