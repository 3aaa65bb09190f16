#include "scene/obj/file/face_reader.h"

#include <algorithm>

namespace voxdag::obj {

FaceReader::FaceReader(const ObjFile& obj, unsigned cursors, MemoryBudget& budget)
    : obj_(obj), polygons_(obj, budget) {
  if (obj.has_splits()) splitter_ = std::make_unique<Splitter>(obj, cursors, budget);
}

void FaceReader::read(uint64_t first, uint64_t count, uint32_t* corners, Surfaces* surfaces) {
  if (surfaces) *surfaces = {};
  seek(first);
  for (const uint64_t end = first + count;;) {
    for (const uint64_t face_end = std::min(end, this->face_end()); first < face_end; ++first) {
      for (size_t k = 0; k < 3; ++k) *corners++ = polygons_.vertices()[corner_of(first, k)];
      if (!surfaces) continue;
      for (size_t k = 0; k < 3; ++k)
        surfaces->texcoords.push_back(polygons_.texcoord(corner_of(first, k)));
      surfaces->materials.push_back(polygons_.material());
    }
    if (first == end) return;
    load(face_end());
  }
}

std::string FaceReader::place_of(uint64_t triangle) {
  seek(triangle);
  return polygons_.place();
}

std::string FaceReader::index_text(uint64_t triangle, size_t corner) {
  seek(triangle);
  return polygons_.index_text(corner_of(triangle, corner));
}

// Reads the face that contains the triangle. Continues from the current face, unless the triangle
// is in an earlier face or in a later block of recorded faces (block_index.h). In these cases,
// starts at the triangle's block.
void FaceReader::seek(uint64_t triangle) {
  const bool is_ahead = is_loaded_ && triangle >= first_triangle_;
  if (is_ahead && triangle < face_end()) return;
  const auto& index = obj_.face_index();
  const uint64_t block = index.find(triangle, &ObjFile::FacePlace::first_triangle);
  if (!is_ahead || polygons_.face() < block) {
    is_loaded_ = false;
    polygons_.seek(index.at(block), block);
    load(index.at(block).first_triangle);
  }
  while (triangle >= face_end()) load(face_end());
}

// Reads the next face. `first_triangle` is the number of the face's first triangle.
void FaceReader::load(uint64_t first_triangle) {
  is_loaded_ = false;
  polygons_.next();
  first_triangle_ = first_triangle;
  split_ = {};
  if (polygons_.size() > 3 && obj_.face_index().at(polygons_.face()).has_splits)
    split_ = splitter_->faces.split(polygons_.vertices());
  is_loaded_ = true;
}

// Returns the number of the first triangle of the next face.
uint64_t FaceReader::face_end() const {
  return first_triangle_ + (polygons_.size() < 3 ? 0 : polygons_.size() - 2);
}

// Returns the position, in the current face, of corner `k` of a triangle.
size_t FaceReader::corner_of(uint64_t triangle, size_t k) const {
  return polygon::position_of_corner(split_, static_cast<size_t>(triangle - first_triangle_), k);
}

}  // namespace voxdag::obj
