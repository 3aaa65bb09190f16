// Checks that an accessor has the type that its use requires, and that its bytes lie inside its
// buffer.
#pragma once

#include <string>
#include <vector>

#include "core/scene/gltf/document/document.h"

namespace voxdag::gltf {

// How an accessor is used, which determines the type it must have.
struct AccessorUse {
  std::string where;  // "mesh 0: primitive 2: POSITION"
  int components;
  std::vector<int> types;
  std::vector<int> may_be_normalized = {};
};

// Throws Error{kInvalidInput} unless accessor `index` exists, has a type of the use, its elements
// lie inside its view, and its view inside the length that its buffer claims; Error{kLimit} for
// over 2^32 elements. Accepts -1, no accessor. Marks the buffers of the accessor as read.
void check_accessor(Document& document, int index, const AccessorUse& use);

// Throws Error{kInvalidInput} unless accessor `index` has `count` elements or is -1.
void check_count(const Document& document, int index, uint64_t count, const std::string& where);

// Throws Error{kInvalidInput} unless index < size: "<where>: <what> <index> does not exist ...".
void check_index(const Document& document, size_t size, int index, const std::string& where,
                 const char* what);

}  // namespace voxdag::gltf
