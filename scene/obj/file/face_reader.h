// Reads the triangles of an OBJ file as three corners each, starting at any triangle. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "scene/obj/file/obj_file.h"
#include "scene/obj/file/polygon_reader.h"
#include "scene/obj/file/vertex_reader.h"
#include "scene/polygon/face_splitter.h"

namespace voxdag::obj {

class FaceReader {
 public:
  // Texture coordinates and materials of triangles.
  struct Surfaces {
    std::vector<uint32_t> texcoords;  // three indices per triangle; kNoIndex: none
    std::vector<uint32_t> materials;  // number in ObjFile::materials()
  };

  // `cursors` is the number of cursors that share the budget. The file must outlive the reader.
  FaceReader(const ObjFile& obj, unsigned cursors, MemoryBudget& budget);

  // Writes the vertex indices of triangles [first, first + count) to `corners`, three per triangle,
  // and replaces `surfaces`, if it is not null. The triangles must exist, but their indices may be
  // out of range. Throws Error{kInvalidInput} with face and line for a corner that is not an index.
  void read(uint64_t first, uint64_t count, uint32_t* corners, Surfaces* surfaces);
  // Returns the face and line of a triangle, for messages.
  std::string place_of(uint64_t triangle);
  // Returns the vertex index of a corner as written in the file.
  std::string index_text(uint64_t triangle, size_t corner);

 private:
  struct Splitter {
    Positions vertices;
    polygon::FaceSplitter faces;

    Splitter(const ObjFile& obj, unsigned cursors, MemoryBudget& budget)
        : vertices(obj, budget), faces(vertices, obj.file().path(), cursors, budget) {}
  };

  void seek(uint64_t triangle);
  void load(uint64_t first_triangle);
  uint64_t face_end() const;
  size_t corner_of(uint64_t triangle, size_t k) const;

  const ObjFile& obj_;
  PolygonReader polygons_;
  std::unique_ptr<Splitter> splitter_;  // null if all faces are fans around their first corner
  // The first triangle of the current face, and the triangles of the face if they are not a fan.
  // Valid only if is_loaded_ is true.
  bool is_loaded_ = false;
  uint64_t first_triangle_ = 0;
  std::span<const uint32_t> split_;
};

}  // namespace voxdag::obj
