// The vertex indices of a primitive's triangles, three each, out of triangle lists, strips and
// fans, indexed or not. Winding is not kept: a voxel does not care.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/scene/gltf/geometry/accessor_reader.h"

namespace voxdag::gltf {

class CornerReader {
 public:
  CornerReader(const Document& document, BufferReader& buffers, const Primitive& primitive);

  // Those of triangles [first, first + count); may be beyond the vertices that are there.
  void read(uint64_t first, size_t count, uint32_t* corners);

 private:
  void read_indices(uint64_t first, size_t count, uint32_t* out);

  const int mode_;
  std::optional<AccessorReader> indices_;  // none: vertices in their own order
  std::vector<uint32_t> row_;              // consecutive indices of a strip or fan
};

}  // namespace voxdag::gltf
