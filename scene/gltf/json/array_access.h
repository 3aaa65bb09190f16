// Access to the arrays of a document by glTF's indices, which are of type int.
#pragma once

#include <cstddef>

namespace voxdag::gltf {

template <class Array>
int size_of(const Array& array) {
  return static_cast<int>(array.size());
}
template <class Array>
const auto& at(const Array& array, int index) {
  return array[static_cast<size_t>(index)];
}

}  // namespace voxdag::gltf
