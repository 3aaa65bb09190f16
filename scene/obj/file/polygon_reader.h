// Reads the polygons of an OBJ file, its f statements, one after another. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "scene/obj/file/corners.h"
#include "scene/obj/file/obj_file.h"
#include "scene/text/line_reader.h"

namespace voxdag::obj {

class PolygonReader {
 public:
  // Maximum number of corners of a polygon.
  static constexpr size_t kMaxCorners = 32768;

  // The file must outlive the reader.
  PolygonReader(const ObjFile& obj, MemoryBudget& budget)
      : obj_(obj), lines_(obj.file(), budget, LineReader::Join::kBackslash) {}

  // Moves to the polygon at `place`, whose number is `face`.
  void seek(const ObjFile::FacePlace& place, uint64_t face);
  // Reads the next polygon, which must exist. Throws Error{kInvalidInput} with face and line for a
  // corner that is not an index.
  void next();

  // Return the polygon's number, its number of corners, the vertex indices of its corners (which
  // may be out of range), and its material as a number in ObjFile::materials().
  uint64_t face() const { return next_face_ - 1; }
  size_t size() const { return corners_.size(); }
  std::span<const uint32_t> vertices() const { return vertices_; }
  uint32_t material() const { return material_; }
  // Returns the index of a corner's texture coordinates.
  uint32_t texcoord(size_t k) const { return resolve(corners_[k].texture, texcoords_before_); }
  // Return texts for messages: the polygon with its line, and the vertex index of corner `k` as it
  // is written in the file.
  std::string place() const;
  std::string index_text(size_t k) const;

 private:
  void parse(std::string_view arguments);

  const ObjFile& obj_;
  LineReader lines_;
  uint64_t next_face_ = 0;
  uint64_t vertices_before_ = 0, texcoords_before_ = 0;  // v and vt statements before the face
  uint32_t material_ = 0;
  std::vector<Corner> corners_;
  std::vector<uint32_t> vertices_;
};

// Return parts of messages: the face with its line, and a description of a corner that is not an
// index. `rest` is the text of the line from this corner.
std::string place_of_face(uint64_t face, uint64_t line);
std::string describe_bad_corner(size_t corner, std::string_view rest);

}  // namespace voxdag::obj
