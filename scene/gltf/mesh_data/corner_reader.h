// The vertex indices of the triangles of a primitive, three each, out of triangle lists, strips and
// fans, indexed or not. The winding of strips is not corrected: surfaces say where it is the other
// way. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "scene/gltf/mesh_data/accessor_reader.h"

namespace voxdag::gltf {

class CornerReader {
 public:
  CornerReader(const Document& document, BufferReader& buffers, const Primitive& primitive);

  // Reads the indices of triangles [first, first + count). They may be out of range.
  void read(uint64_t first, size_t count, uint32_t* corners);

 private:
  void read_indices(uint64_t first, size_t count, uint32_t* out);

  const int mode_;
  std::optional<AccessorReader> indices_;  // none: vertices in their own order
  std::vector<uint32_t> row_;              // consecutive indices of a strip or fan
};

}  // namespace voxdag::gltf
