// Reads the triangles of a PLY file as three vertex indices each, starting at any triangle. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <memory>

#include "scene/ply/ply_file.h"

namespace voxdag::ply {

class FaceReader {
 public:
  // The file must outlive the reader.
  FaceReader(const PlyFile& ply, MemoryBudget& budget) : ply_(ply), rows_(ply.open_faces(budget)) {}

  // Writes the vertex indices of triangles [first, first + count) to `corners`, three per triangle.
  // The triangles must exist, but their vertex indices may be out of range.
  void read(uint64_t first, uint64_t count, uint32_t* corners);
  // Returns the number of the face that contains a triangle.
  uint64_t face_of(uint64_t triangle);

 private:
  void seek(uint64_t triangle);
  void load();
  uint64_t face_end() const;

  const PlyFile& ply_;
  const std::unique_ptr<Rows> rows_;
  // The face that rows_ read last, its first triangle, and the offset of the next face. Valid only
  // if is_loaded_ is true.
  bool is_loaded_ = false;
  uint64_t face_ = 0, first_triangle_ = 0, next_offset_ = 0;
};

}  // namespace voxdag::ply
