// Numbers of the vertices of a PLY file: the values of some of their properties, such as positions.
// Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "scene/gltf/mesh_data/position_source.h"
#include "scene/ply/ascii_text.h"
#include "scene/ply/file_window.h"
#include "scene/ply/mesh.h"

namespace voxdag::ply {

class VertexReader : public gltf::PositionSource {
 public:
  // Of the vertex element's properties with these indices. The mesh must outlive the reader.
  VertexReader(const Mesh& mesh, std::span<const size_t> properties, MemoryBudget& budget);

  uint64_t count() const override { return mesh_.vertex_element().count; }
  // As many numbers for each vertex as there are properties. Throws Error{kInvalidInput} naming the
  // vertex for text that is no number.
  void read(uint64_t first, size_t count, double* out) override;

 private:
  void read_binary(uint64_t first, size_t count, double* out);
  void read_text(uint64_t first, size_t count, double* out);
  void read_line(uint64_t vertex, double* out);

  const Mesh& mesh_;
  std::optional<FileWindow> window_;
  std::optional<AsciiText> text_;
  const std::vector<size_t> properties_;
  std::vector<size_t> offsets_;  // of each of them in a row
  size_t row_bytes_ = 0;
};

}  // namespace voxdag::ply
