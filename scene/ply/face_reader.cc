#include "scene/ply/face_reader.h"

#include <algorithm>
#include <cmath>

namespace voxdag::ply {

FaceReader::FaceReader(const PlyFile& ply, unsigned cursors, MemoryBudget& budget)
    : ply_(ply), budget_(budget), rows_(ply.open_faces({}, budget)) {
  const auto has_splits = [](const PlyFile::FaceBlock& block) { return block.has_splits; };
  if (std::ranges::any_of(ply.face_blocks(), has_splits))
    splitter_ = std::make_unique<Splitter>(ply, cursors, budget);
}

void FaceReader::request(const RequestedProperties& others) {
  is_loaded_ = false;
  has_surfaces_ = true;
  rows_.reset();
  rows_ = ply_.open_faces(others, budget_);
}

void FaceReader::read(uint64_t first, uint64_t count, uint32_t* corners, Surfaces& surfaces) {
  surfaces.numbers.clear();
  surfaces.texcoords.clear();
  seek(first);
  for (const uint64_t end = first + count;;) {
    const uint64_t face_end = std::min(end, this->face_end());
    corners = copy_corners(first, face_end, corners);
    for (; first < face_end; ++first)
      if (has_surfaces_) add_surface(first, surfaces);
    if (first == end) return;
    load();
  }
}

// Writes the corners of triangles [first, end) of the current face to `out`. Returns the end of the
// written corners.
uint32_t* FaceReader::copy_corners(uint64_t first, uint64_t end, uint32_t* out) const {
  const auto indices = rows_->indices();
  const auto split = split_;
  for (; first < end; ++first)
    for (size_t k = 0; k < 3; ++k)
      *out++ = indices[polygon::position_of_corner(
          split, static_cast<size_t>(first - first_triangle_), k)];
  return out;
}

void FaceReader::add_surface(uint64_t triangle, Surfaces& out) const {
  const auto numbers = rows_->numbers(), reals = rows_->reals();
  out.numbers.insert(out.numbers.end(), numbers.begin(), numbers.end());
  auto& pairs = out.texcoords.emplace_back();
  pairs.fill(std::nan(""));
  if (reals.size() != 2 * rows_->indices().size()) return;
  for (size_t k = 0; k < 3; ++k) std::copy_n(&reals[2 * corner_of(triangle, k)], 2, &pairs[2 * k]);
}

uint64_t FaceReader::face_of(uint64_t triangle) {
  seek(triangle);
  return face_;
}

// Reads the face that contains the triangle. Continues from the current face, unless the triangle
// is in an earlier face or in a later block of PlyFile::face_blocks(). In these cases, starts at
// the triangle's block.
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
    load_at(blocks[static_cast<size_t>(block)].offset);
  }
  while (triangle >= face_end()) load();
}

// Reads the next face.
void FaceReader::load() {
  first_triangle_ = face_end();
  ++face_;
  load_at(next_offset_);
}

void FaceReader::load_at(uint64_t offset) {
  is_loaded_ = false;
  next_offset_ = rows_->read(face_, offset);
  split_ = {};
  const auto indices = rows_->indices();
  if (indices.size() > 3 && ply_.face_blocks()[face_ / PlyFile::kBlockRows].has_splits)
    split_ = splitter_->faces.split(indices);
  is_loaded_ = true;
}

// Returns the number of the first triangle of the next face.
uint64_t FaceReader::face_end() const {
  const size_t corners = rows_->indices().size();
  return first_triangle_ + (corners < 3 ? 0 : corners - 2);
}

// Returns the position, in the current face, of corner `k` of a triangle.
size_t FaceReader::corner_of(uint64_t triangle, size_t k) const {
  return polygon::position_of_corner(split_, static_cast<size_t>(triangle - first_triangle_), k);
}

}  // namespace voxdag::ply
