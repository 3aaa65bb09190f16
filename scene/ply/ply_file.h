// An open PLY file: the positions of its vertices, faces and strips in the file, and the number of
// triangles. The triangles of the faces are numbered first, then the triangles of the strips. A
// face of n corners has n - 2 triangles (scene/polygon); a face with fewer than three corners has
// none.
//
// Rows of faces and strips, all rows of ASCII files, and vertices with lists have no fixed size. So
// one pass over the file records positions at regular intervals. To find any other position, a
// reader starts at the last recorded position before it. A second pass over the faces finds the
// blocks that contain faces that are not fans.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "core/io/file_system.h"
#include "scene/growing_charge.h"
#include "scene/ply/layout.h"
#include "scene/ply/rows/header.h"
#include "scene/ply/rows/rows.h"
#include "scene/ply/rows/strip_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag::ply {

class PlyFile {
 public:
  // Number of vertices, faces or triangles of strips between two recorded positions.
  static constexpr uint64_t kBlockRows = 1024;

  // Throws Error{kInvalidInput} with the line, element or row of the damage. Throws Error{kLimit}
  // for more than 2^32 - 2 vertices, and Error{kOutOfMemory} if the list of recorded rows does not
  // fit the budget.
  PlyFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget, const CancelToken& cancel);

  // A block of kBlockRows faces.
  struct FaceBlock {
    uint64_t offset;          // offset of its first face in the file
    uint64_t first_triangle;  // number of its first triangle
    bool has_splits;          // true if some of its faces are not fans
  };

  const ReadableFile& file() const { return *file_; }
  Format format() const { return header_.format; }
  const Header& header() const { return header_; }
  const Layout& layout() const { return layout_; }
  // False if the file has neither faces nor strips. Then its vertices are points.
  bool has_primitives() const {
    return layout_.face != Layout::kNone || layout_.strips != Layout::kNone;
  }
  uint64_t face_triangles() const { return face_triangles_; }
  uint64_t triangles() const { return face_triangles_ + strip_triangles_; }
  const std::vector<Warning>& warnings() const { return warnings_.list(); }

  const Element& vertex_element() const { return header_.elements[layout_.vertex]; }
  uint64_t vertices_begin() const { return vertices_begin_; }
  // Offsets in the file of every kBlockRows-th vertex. Empty if the vertices have a fixed size.
  const std::deque<uint64_t>& vertex_blocks() const { return vertex_blocks_; }

  // The file must have faces.
  const Element& face_element() const { return header_.elements[layout_.face]; }
  const std::deque<FaceBlock>& face_blocks() const { return face_blocks_; }
  // Returns a reader of the faces' vertex indices and of other properties.
  std::unique_ptr<Rows> open_faces(RequestedProperties others, MemoryBudget& budget) const;

  // Positions before every kBlockRows-th triangle of the strips. The file must have strips.
  const std::deque<StripReader::Position>& strip_blocks() const { return strip_blocks_; }
  StripReader open_strips(MemoryBudget& budget) const;

 private:
  // `place` is the part of the file that the warning is about; "" is the complete file.
  void warn(const char* code, const std::string& place, const std::string& message,
            uint64_t count = 1);
  void warn_about_header();
  void pass_over_elements(MemoryBudget& budget, const CancelToken& cancel);
  uint64_t pass_over(size_t element, uint64_t begin, MemoryBudget& budget,
                     const CancelToken& cancel);
  uint64_t pass_over_strips(uint64_t begin, MemoryBudget& budget, const CancelToken& cancel);
  uint64_t end_of_fixed_rows(const Element& element, uint64_t begin) const;
  void note_row(size_t element, uint64_t offset);
  void note_face(size_t corners);
  void check_end(uint64_t offset, MemoryBudget& budget) const;
  void find_splits(MemoryBudget& budget, const CancelToken& cancel);
  [[noreturn]] void refuse(const std::string& what) const;

  const std::unique_ptr<ReadableFile> file_;
  Header header_;
  Layout layout_;
  uint64_t vertices_begin_ = 0;
  uint64_t face_triangles_ = 0, strip_triangles_ = 0;
  uint64_t small_faces_ = 0;  // faces of fewer than three corners
  std::deque<uint64_t> vertex_blocks_;
  std::deque<FaceBlock> face_blocks_;
  std::deque<StripReader::Position> strip_blocks_;
  GrowingCharge charge_;         // charge for the blocks
  std::string first_irregular_;  // the first row of an ASCII file that is not exactly one line
  WarningList warnings_;
};

}  // namespace voxdag::ply
