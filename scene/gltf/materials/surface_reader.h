// Reads the material, texture coordinates and colors of a primitive's triangles, within a fixed
// amount of memory. Blocks of consecutive vertices are cached, as in VertexCache. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/page_buffer.h"
#include "core/color/surface.h"
#include "scene/gltf/materials/document_materials.h"
#include "scene/gltf/mesh_data/accessor_reader.h"

namespace voxdag::gltf {

class SurfaceReader {
 public:
  // The caches of all readers of a scene together take at most 1/kShareOfFree of the free bytes of
  // the memory budget.
  static constexpr uint64_t kShareOfFree = 8;

  // Makes one of `readers` readers that divide 1/kShareOfFree of the free bytes equally. Its cache
  // has space for `vertices` vertices, or for fewer if its part of these bytes is too small. Call
  // resolve_materials() first. `document` and `buffers` must outlive the reader.
  SurfaceReader(const Document& document, BufferReader& buffers, uint64_t vertices,
                unsigned readers);

  // Makes read() use another primitive of the document. Throws Error{kInvalidInput} if a buffer of
  // its surface is shorter than declared.
  void bind(const Primitive& primitive);
  // Sets the material and corners of `out`, a triangle of this primitive. `vertices` are its three
  // vertex indices, which must exist.
  void read(const uint32_t* vertices, SurfaceTriangle& out) {
    out.material = material_;
    for (size_t k = 0; k < 3; ++k) out.corners[k] = is_plain_ ? SurfaceCorner{} : at(vertices[k]);
  }

 private:
  static constexpr uint64_t kBlockVertices = 1024;
  static constexpr uint64_t kNoBlock = ~uint64_t{0};

  const SurfaceCorner& at(uint32_t vertex) {
    const uint64_t block = vertex / kBlockVertices;
    const size_t slot = static_cast<size_t>(block) & slot_mask_;
    if (block_in_slot_[slot] != block) load(block, slot);
    return corners_[slot * kBlockVertices + vertex % kBlockVertices];
  }
  void open(int accessor, std::optional<AccessorReader>& out);
  void load(uint64_t block, size_t slot);
  void load_texture_coordinates(uint64_t first, size_t count, SurfaceCorner* out);
  void load_colors(uint64_t first, size_t count, SurfaceCorner* out);

  const Document& document_;
  BufferReader& buffers_;
  uint32_t material_ = 0;
  bool is_plain_ = true;  // the primitive has no texture coordinates and no colors
  TextureTransform transform_;
  std::optional<AccessorReader> texture_coordinates_, colors_;
  size_t color_components_ = 4;
  double color_scale_ = 1;  // divisor for integer colors without the required `normalized` flag
  uint64_t vertices_ = 0;

  PageBuffer<SurfaceCorner> corners_;
  std::vector<uint64_t> block_in_slot_;
  size_t slot_mask_ = 0;
  std::vector<double> numbers_;
};

}  // namespace voxdag::gltf
