// Reads the triangles of a PLY file's faces, three vertex indices each, starting at any triangle.
// Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "scene/ply/ply_file.h"
#include "scene/ply/vertex_reader.h"
#include "scene/polygon/face_splitter.h"

namespace voxdag::ply {

class FaceReader {
 public:
  // The values that read() returns for the triangles. They are values of the triangles' faces.
  struct Surfaces {
    std::vector<double> numbers;                   // the requested numbers, for each triangle
    std::vector<std::array<double, 6>> texcoords;  // three pairs; NaN if the face does not have
                                                   // two numbers per corner
  };

  // `cursors` is the number of cursors that share the budget. The file must outlive the reader.
  FaceReader(const PlyFile& ply, unsigned cursors, MemoryBudget& budget);

  // Makes later calls of read() also return these properties of faces.
  void request(const RequestedProperties& others);
  // Writes the vertex indices of triangles [first, first + count) to `corners`, three per triangle.
  // Clears `surfaces`, and fills it if request() was called. The triangles must exist, but their
  // vertex indices may be out of range.
  void read(uint64_t first, uint64_t count, uint32_t* corners, Surfaces& surfaces);
  // Returns the number of the face that contains a triangle.
  uint64_t face_of(uint64_t triangle);

 private:
  struct Splitter {
    VertexReader vertices;
    polygon::FaceSplitter faces;

    Splitter(const PlyFile& ply, unsigned cursors, MemoryBudget& budget)
        : vertices(ply, ply.layout().axes, budget),
          faces(vertices, ply.file().path(), cursors, budget) {}
  };

  void seek(uint64_t triangle);
  void load();
  void load_at(uint64_t offset);
  uint64_t face_end() const;
  size_t corner_of(uint64_t triangle, size_t k) const;
  uint32_t* copy_corners(uint64_t first, uint64_t end, uint32_t* out) const;
  void add_surface(uint64_t triangle, Surfaces& out) const;

  const PlyFile& ply_;
  MemoryBudget& budget_;
  std::unique_ptr<Rows> rows_;
  bool has_surfaces_ = false;
  std::unique_ptr<Splitter> splitter_;  // null if all faces are fans
  // The face that rows_ read last, its first triangle, its triangles if they are not a fan, and the
  // offset of the next face. Valid only if is_loaded_ is true.
  bool is_loaded_ = false;
  uint64_t face_ = 0, first_triangle_ = 0, next_offset_ = 0;
  std::span<const uint32_t> split_;
};

}  // namespace voxdag::ply
