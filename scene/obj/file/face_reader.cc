#include "scene/obj/file/face_reader.h"

#include <algorithm>

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/obj/file/statement.h"

namespace voxdag::obj {

void FaceReader::read(uint64_t first, uint64_t count, uint32_t* corners, Surfaces* surfaces) {
  if (surfaces) *surfaces = {};
  seek(first);
  for (const uint64_t end = first + count;;) {
    for (const uint64_t face_end = std::min(end, this->face_end()); first < face_end; ++first) {
      for (int k = 0; k < 3; ++k)
        *corners++ = resolve(entries_[entry_of(first, k)].vertex, vertices_);
      if (!surfaces) continue;
      for (int k = 0; k < 3; ++k) surfaces->texcoords.push_back(texcoord(entry_of(first, k)));
      surfaces->materials.push_back(material_);
    }
    if (first == end) return;
    load();
  }
}

std::string FaceReader::place_of(uint64_t triangle) {
  seek(triangle);
  return place();
}

int64_t FaceReader::index_in_file(uint64_t triangle, int corner) {
  seek(triangle);
  return entries_[entry_of(triangle, corner)].vertex;
}

// Reads the face that contains the triangle. Continues from the current face, unless the triangle
// is in an earlier face or a later block. In these cases, starts at the triangle's block.
void FaceReader::seek(uint64_t triangle) {
  const bool is_ahead = is_loaded_ && triangle >= first_triangle_;
  if (is_ahead && triangle < face_end()) return;
  const auto& index = obj_.face_index();
  const uint64_t block = index.find(triangle, &ObjFile::FacePlace::first_triangle);
  if (!is_ahead || face_ < block) {
    const ObjFile::FacePlace& place = index.at(block);
    is_loaded_ = false;
    lines_.seek(place.place.offset, place.place.line);
    face_ = block - 1;
    first_triangle_ = place.first_triangle;
    vertices_ = place.vertices;
    texcoords_ = place.texcoords;
    material_ = place.material;
    entries_.clear();
    load();
  }
  while (triangle >= face_end()) load();
}

// Reads the next face.
void FaceReader::load() {
  first_triangle_ = face_end();
  is_loaded_ = false;
  while (lines_.next()) {
    const Statement statement = statement_of(lines_.text());
    switch (statement.kind) {
      case Kind::kVertex:
        ++vertices_;
        break;
      case Kind::kTexture:
        ++texcoords_;
        break;
      case Kind::kUseMaterial:
        material_ = obj_.materials().number_of(trimmed(statement.arguments));
        break;
      case Kind::kFace:
        ++face_;
        parse(statement.arguments);
        is_loaded_ = true;
        return;
      default:
        break;
    }
  }
  refuse(obj_.file().path(), "changed while it was read: expected a file that does not change");
}

void FaceReader::parse(std::string_view arguments) {
  entries_.clear();
  while (has_word(arguments)) {
    const std::string_view rest = arguments;
    Corner corner;
    if (!next_corner(arguments, corner)) {
      std::string_view word = rest;
      refuse(obj_.file().path(), place() + ": corner " + std::to_string(entries_.size()) + " is " +
                                     printable(next_word(word)) +
                                     ", expected v, v/vt, v//vn or v/vt/vn");
    }
    if (entries_.size() == kMaxCorners)
      throw Error(ErrorCode::kLimit, obj_.file().path() + ": " + place() +
                                         " has more corners than the limit, " +
                                         std::to_string(kMaxCorners));
    entries_.push_back(corner);
  }
}

// Returns the number of the first triangle of the next face.
uint64_t FaceReader::face_end() const {
  return first_triangle_ + (entries_.size() < 3 ? 0 : entries_.size() - 2);
}

// Returns the position in entries_ of a corner of a triangle of the current face.
size_t FaceReader::entry_of(uint64_t triangle, int corner) const {
  return corner == 0 ? 0 : static_cast<size_t>(triangle - first_triangle_ + corner);
}

std::string FaceReader::place() const {
  return "face " + std::to_string(face_) + " in line " + std::to_string(lines_.number());
}

}  // namespace voxdag::obj
