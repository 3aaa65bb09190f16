// Reads the triangles of an OBJ file as three corners each, starting at any triangle. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/obj/file/corners.h"
#include "scene/obj/file/obj_file.h"
#include "scene/text/line_reader.h"

namespace voxdag::obj {

class FaceReader {
 public:
  // Maximum number of corners of a face.
  static constexpr size_t kMaxCorners = 32768;

  // Texture coordinates and materials of triangles.
  struct Surfaces {
    std::vector<uint32_t> texcoords;  // three indices per triangle; kNoIndex: none
    std::vector<uint32_t> materials;  // number in ObjFile::materials()
  };

  // The file must outlive the reader.
  FaceReader(const ObjFile& obj, MemoryBudget& budget)
      : obj_(obj), lines_(obj.file(), budget, LineReader::Join::kBackslash) {}

  // Writes the vertex indices of triangles [first, first + count) to `corners`, three per triangle,
  // and replaces `surfaces`, if it is not null. The triangles must exist, but their indices may be
  // out of range. Throws Error{kInvalidInput} with face and line for a corner that is no index.
  void read(uint64_t first, uint64_t count, uint32_t* corners, Surfaces* surfaces);
  // Returns the face and line of a triangle, for messages.
  std::string place_of(uint64_t triangle);
  // Returns the vertex index of a corner as written in the file.
  int64_t index_in_file(uint64_t triangle, int corner);

 private:
  void seek(uint64_t triangle);
  void load();
  void parse(std::string_view arguments);
  uint64_t face_end() const;
  size_t entry_of(uint64_t triangle, int corner) const;
  std::string place() const;
  uint32_t texcoord(size_t entry) const { return resolve(entries_[entry].texture, texcoords_); }

  const ObjFile& obj_;
  LineReader lines_;
  // The current face: its number, corners and first triangle, the statements before it, and its
  // material. Valid only if is_loaded_ is true.
  bool is_loaded_ = false;
  uint64_t face_ = 0, first_triangle_ = 0;
  uint64_t vertices_ = 0, texcoords_ = 0;
  uint32_t material_ = 0;
  std::vector<Corner> entries_;
};

}  // namespace voxdag::obj
