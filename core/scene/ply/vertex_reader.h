// The positions of the vertices of a PLY file. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/scene/gltf/mesh_data/position_source.h"
#include "core/scene/ply/ascii_text.h"
#include "core/scene/ply/file_window.h"
#include "core/scene/ply/mesh.h"

namespace voxdag::ply {

class VertexReader : public gltf::PositionSource {
 public:
  // The mesh must outlive the reader.
  VertexReader(const Mesh& mesh, MemoryBudget& budget);

  uint64_t count() const override { return mesh_.vertex_element().count; }
  // Throws Error{kInvalidInput} naming the vertex for text that is no number.
  void read(uint64_t first, size_t count, double* out) override;

 private:
  void read_binary(uint64_t first, size_t count, double* out);
  void read_text(uint64_t first, size_t count, double* out);
  void read_line(uint64_t vertex, double* out);

  const Mesh& mesh_;
  std::optional<FileWindow> window_;
  std::optional<AsciiText> text_;
  size_t row_bytes_ = 0;
  std::array<size_t, 3> offsets_{};  // of x, y and z in a row
};

}  // namespace voxdag::ply
