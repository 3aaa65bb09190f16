// Reads the values of some properties, such as positions, of the vertices of a PLY file. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "scene/ply/ply_file.h"
#include "scene/ply/rows/rows.h"
#include "scene/text/file_window.h"
#include "scene/vertices/position_source.h"

namespace voxdag::ply {

class VertexReader : public PositionSource {
 public:
  // Reads the vertex properties with these indices. The file must outlive the reader.
  VertexReader(const PlyFile& ply, std::span<const size_t> properties, MemoryBudget& budget);

  uint64_t count() const override { return ply_.vertex_element().count; }
  // Writes one number per property for each of the vertices [first, first + count). Throws
  // Error{kInvalidInput} with the vertex for a text that is not a number.
  void read(uint64_t first, size_t count, double* out) override;

 private:
  void read_fixed(uint64_t first, size_t count, double* out);
  void read_rows(uint64_t first, size_t count, double* out);

  const PlyFile& ply_;
  const std::vector<size_t> properties_;
  std::unique_ptr<Rows> rows_;  // reader of vertices that vary in size
  // Used instead of rows_ for vertices of a fixed size:
  std::optional<FileWindow> window_;  // the part of the file that is being read
  std::vector<size_t> offsets_;       // for each of properties_, its offset in a vertex, in bytes
  size_t row_bytes_ = 0;              // size of a vertex in the file
};

}  // namespace voxdag::ply
