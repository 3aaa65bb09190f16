// Checks that an accessor is what its user expects, and that all of its bytes lie where they can.
#pragma once

#include <string>
#include <vector>

#include "core/scene/gltf/document/document.h"

namespace voxdag::gltf {

// How an accessor is used, and so the type it must have.
struct AccessorUse {
  std::string where;  // "mesh 0: primitive 2: POSITION"
  int components;
  std::vector<int> types;
  std::vector<int> may_be_normalized = {};
};

// Throws Error{kInvalidInput} unless accessor `index` exists, fits the use, and its elements lie
// inside its view and its view inside what its buffer claims; Error{kLimit} for over 2^32 elements.
// -1, no accessor, is always right. Marks the buffers it lies in as read.
void check_accessor(Document& document, int index, const AccessorUse& use);

// Throws Error{kInvalidInput} unless accessor `index`, if there is one, has `count` elements.
void check_count(const Document& document, int index, uint64_t count, const std::string& where);

// Throws Error{kInvalidInput} unless index < size: "<where>: <what> <index> does not exist ...".
void check_index(const Document& document, size_t size, int index, const std::string& where,
                 const char* what);

}  // namespace voxdag::gltf
