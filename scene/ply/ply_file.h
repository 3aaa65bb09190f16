// An open PLY file: the positions of its vertices and faces in the file, and the number of
// triangles. A polygon of n corners is the fan of n - 2 triangles around its first corner. A
// polygon with fewer than three corners has no triangle.
//
// Rows of faces and all rows of ASCII files have no fixed size. So one pass over the file records
// the offset of every 1024th row. Any other row is found by reading on from the last recorded row
// before it.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/growing_charge.h"
#include "scene/ply/header.h"
#include "scene/ply/rows.h"
#include "voxdag/cancel_token.h"

namespace voxdag::ply {

class PlyFile {
 public:
  static constexpr uint64_t kBlockRows = 1024;

  // Throws Error{kInvalidInput} with the line, element or row of the damage, Error{kLimit} for more
  // than 2^32 - 2 vertices, Error{kOutOfMemory} if the list of recorded rows does not fit the
  // budget.
  PlyFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget, const CancelToken& cancel);

  // A block of kBlockRows faces: the offset of its first face in the file, and the number of its
  // first triangle.
  struct FaceBlock {
    uint64_t offset;
    uint64_t first_triangle;
  };

  const ReadableFile& file() const { return *file_; }
  Format format() const { return header_.format; }
  uint64_t triangles() const { return triangles_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

  const Element& vertex_element() const { return header_.elements[vertex_]; }
  uint64_t vertices_begin() const { return vertices_begin_; }
  // Offsets in the file of every kBlockRows-th vertex. Empty for a binary file, whose vertices have
  // a fixed size.
  const std::deque<uint64_t>& vertex_blocks() const { return vertex_blocks_; }
  // Indices of the properties x, y and z.
  const std::array<size_t, 3>& axes() const { return axes_; }
  // Indices of the properties red, green, blue and, if present, alpha. Empty unless all three
  // colors exist.
  const std::vector<size_t>& colors() const { return colors_; }

  const std::deque<FaceBlock>& face_blocks() const { return face_blocks_; }
  std::unique_ptr<Rows> open_faces(MemoryBudget& budget) const;

 private:
  void find_vertex_properties();
  void find_face_list();
  uint64_t pass_over(size_t element, uint64_t begin, MemoryBudget& budget,
                     const CancelToken& cancel);
  uint64_t end_of_fixed_rows(const Element& element, uint64_t begin) const;
  void note_row(size_t element, uint64_t offset);
  [[noreturn]] void refuse(const std::string& what) const;

  const std::unique_ptr<ReadableFile> file_;
  Header header_;
  size_t vertex_, face_;  // indices of the two elements; the number of elements if absent
  std::array<size_t, 3> axes_{};
  std::vector<size_t> colors_;
  size_t face_list_ = Rows::kNoList;
  uint64_t vertices_begin_ = 0;
  uint64_t triangles_ = 0;
  std::deque<uint64_t> vertex_blocks_;
  std::deque<FaceBlock> face_blocks_;
  GrowingCharge charge_;  // charge for the blocks
  std::vector<std::string> warnings_;
};

}  // namespace voxdag::ply
