#include "scene/ply/face_reader.h"

#include <algorithm>

namespace voxdag::ply {

void FaceReader::read(uint64_t first, uint64_t count, uint32_t* corners) {
  seek(first);
  for (const uint64_t end = first + count;;) {
    const auto entries = rows_->entries();
    for (const uint64_t face_end = std::min(end, this->face_end()); first < face_end; ++first) {
      const auto k = static_cast<size_t>(first - first_triangle_);
      *corners++ = entries[0];
      *corners++ = entries[k + 1];
      *corners++ = entries[k + 2];
    }
    if (first == end) return;
    load();
  }
}

uint64_t FaceReader::face_of(uint64_t triangle) {
  seek(triangle);
  return face_;
}

// Reads the face that contains the triangle. Continues from the current face, unless the triangle
// is in an earlier face or a later block. In these cases, starts at the triangle's block.
void FaceReader::seek(uint64_t triangle) {
  const auto& blocks = ply_.face_blocks();
  const bool is_ahead = is_loaded_ && triangle >= first_triangle_;
  if (is_ahead && triangle < face_end()) return;
  const auto after =
      std::ranges::upper_bound(blocks, triangle, {}, &PlyFile::FaceBlock::first_triangle);
  const auto block = static_cast<uint64_t>(after - blocks.begin()) - 1;
  if (!is_ahead || face_ < block * PlyFile::kBlockRows) {
    face_ = block * PlyFile::kBlockRows;
    first_triangle_ = blocks[static_cast<size_t>(block)].first_triangle;
    next_offset_ = rows_->read(face_, blocks[static_cast<size_t>(block)].offset);
    is_loaded_ = true;
  }
  while (triangle >= face_end()) load();
}

// Reads the next face.
void FaceReader::load() {
  first_triangle_ = face_end();
  ++face_;
  is_loaded_ = false;
  next_offset_ = rows_->read(face_, next_offset_);
  is_loaded_ = true;
}

// Returns the number of the first triangle of the next face.
uint64_t FaceReader::face_end() const {
  const size_t corners = rows_->entries().size();
  return first_triangle_ + (corners < 3 ? 0 : corners - 2);
}

}  // namespace voxdag::ply
