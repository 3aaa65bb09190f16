// Reads the triangles of a primitive as three vertex indices each, from triangle lists, strips and
// fans, indexed or not. Does not correct the winding of strips without restarts. Instead,
// SurfaceTriangle::is_flipped marks every second triangle of such a strip. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "scene/gltf/mesh_data/accessor_reader.h"

namespace voxdag::gltf {

class CornerReader {
 public:
  CornerReader(const Document& document, BufferReader& buffers, const Primitive& primitive);

  // Writes the vertex indices of triangles [first, first + count) to `corners`, three per triangle.
  // The vertex indices may be out of range.
  void read(uint64_t first, size_t count, uint32_t* corners);

 private:
  void read_indices(uint64_t first, size_t count, uint32_t* out);
  void read_restarts(uint64_t first, size_t count, uint32_t* corners);

  const int mode_;
  const std::shared_ptr<const RestartIndex> restarts_;  // null: no restarts
  std::optional<AccessorReader> indices_;               // none: vertices are used in order
  std::vector<uint32_t> row_;                           // consecutive indices of a strip or fan
};

}  // namespace voxdag::gltf
