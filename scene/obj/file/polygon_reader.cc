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
    if (!next_corner(arguments, corner))
      refuse(obj_.file().path(), place() + ": " + describe_bad_corner(corners_.size(), rest));
    if (corners_.size() == kMaxCorners)
      throw Error(ErrorCode::kLimit, obj_.file().path() + ": " + place() +
                                         " has more corners than the limit, " +
                                         std::to_string(kMaxCorners));
    corners_.push_back(corner);
    vertices_.push_back(resolve(corner.vertex, vertices_before_));
  }
}

std::string PolygonReader::place() const { return place_of_face(face(), lines_.number()); }

std::string PolygonReader::index_text(size_t k) const {
  std::string_view rest = statement_of(lines_.text()).arguments, corner;
  for (size_t i = 0; i <= k; ++i) corner = next_word(rest);
  return printable(corner.substr(0, corner.find('/')));
}

std::string place_of_face(uint64_t face, uint64_t line) {
  return "face " + std::to_string(face) + " in line " + std::to_string(line);
}

std::string describe_bad_corner(size_t corner, std::string_view rest) {
  return "corner " + std::to_string(corner) + " is " + printable(next_word(rest)) +
         ", expected v, v/vt, v//vn or v/vt/vn";
}

}  // namespace voxdag::obj
