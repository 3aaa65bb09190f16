#include "scene/obj/file/polygon_reader.h"

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/obj/file/statement.h"

namespace voxdag::obj {

void PolygonReader::seek(const ObjFile::FacePlace& place, uint64_t face) {
  lines_.seek(place.place.offset, place.place.line);
  next_face_ = face;
  vertices_before_ = place.vertices;
  texcoords_before_ = place.texcoords;
  material_ = place.material;
}

void PolygonReader::next() {
  while (lines_.next()) {
    const Statement statement = statement_of(lines_.text());
    switch (statement.kind) {
      case Kind::kVertex:
        ++vertices_before_;
        break;
      case Kind::kTexture:
        ++texcoords_before_;
        break;
      case Kind::kUseMaterial:
        material_ = obj_.materials().number_of(trimmed(statement.arguments));
        break;
      case Kind::kFace:
        ++next_face_;
        return parse(statement.arguments);
      default:
        break;
    }
  }
  refuse(obj_.file().path(), "changed while it was read: expected a file that does not change");
}

void PolygonReader::parse(std::string_view arguments) {
  corners_.clear();
  vertices_.clear();
  while (has_word(arguments)) {
    const std::string_view rest = arguments;
    Corner corner;
    if (!next_corner(arguments, corner)) {
      std::string_view word = rest;
      refuse(obj_.file().path(), place() + ": corner " + std::to_string(corners_.size()) + " is " +
                                     printable(next_word(word)) +
                                     ", expected v, v/vt, v//vn or v/vt/vn");
    }
    if (corners_.size() == kMaxCorners)
      throw Error(ErrorCode::kLimit, obj_.file().path() + ": " + place() +
                                         " has more corners than the limit, " +
                                         std::to_string(kMaxCorners));
    corners_.push_back(corner);
    vertices_.push_back(resolve(corner.vertex, vertices_before_));
  }
}

std::string PolygonReader::place() const {
  return "face " + std::to_string(face()) + " in line " + std::to_string(lines_.number());
}

}  // namespace voxdag::obj
