// An open OBJ file after one pass over it. It has the numbers of vertices, texture coordinates,
// faces and triangles, and the names of materials and libraries. It also has the file position of
// every n-th vertex, texture coordinate and face (block_index.h). A face of n corners has n - 2
// triangles (scene/polygon); a face with fewer than three corners has none. If there are faces of
// more than three corners, a second pass finds the blocks of faces with concave polygons.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "core/io/file_system.h"
#include "scene/indexed/block_index.h"
#include "scene/obj/file/used_materials.h"
#include "voxdag/cancel_token.h"

namespace voxdag::obj {

class PolygonReader;

class ObjFile {
 public:
  // Throws Error{kInvalidInput} with the line for a free-form curve or surface, a statement `call`
  // (which includes another file), or a damaged polygon; Error{kLimit} for a line that is too long,
  // or for 2^32 - 1 or more vertices or texture coordinates; Error{kOutOfMemory}.
  ObjFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget, const CancelToken& cancel);

  // The beginning of a line.
  struct LinePlace {
    uint64_t offset, line;
  };
  // A face: its line, its first triangle, and the statements before it.
  struct FacePlace {
    LinePlace place;
    uint64_t first_triangle;
    uint64_t vertices, texcoords;  // number of v and vt statements before the face
    uint32_t material;             // number in materials()
    bool has_splits = false;       // some faces of the block are not fans (triangulator.h)
  };
  struct Library {
    std::string names;  // the arguments of the statement
    uint64_t line;
  };

  const ReadableFile& file() const { return *file_; }
  uint64_t vertices() const { return vertices_; }
  uint64_t texcoords() const { return texcoords_; }
  uint64_t triangles() const { return triangles_; }
  const BlockIndex<LinePlace>& vertex_index() const { return vertex_index_; }
  const BlockIndex<LinePlace>& texcoord_index() const { return texcoord_index_; }
  const BlockIndex<FacePlace>& face_index() const { return face_index_; }
  // True if some faces are not divided into the fan around their first corner.
  bool has_splits() const { return has_splits_; }
  // True if a vertex has a color.
  bool has_colors() const { return has_colors_; }
  // Returns the number that means full intensity of a vertex color: 255 if a color of the file has
  // a number above 1, otherwise 1.
  double full_color() const { return full_color_; }
  const UsedMaterials& materials() const { return materials_; }
  const std::vector<Library>& libraries() const { return libraries_; }
  const std::vector<Warning>& warnings() const { return warnings_.list(); }

 private:
  class Scan;

  void add_warnings(const Scan& scan);
  template <class Visit>
  void for_each_polygon(PolygonReader& polygons, const CancelToken& cancel,
                        const Visit& visit) const;
  void count_faces_without_texture(MemoryBudget& budget, const CancelToken& cancel);
  void find_splits(MemoryBudget& budget, const CancelToken& cancel);

  const std::unique_ptr<ReadableFile> file_;
  uint64_t vertices_ = 0, texcoords_ = 0, faces_ = 0, triangles_ = 0;
  BlockIndex<LinePlace> vertex_index_, texcoord_index_;
  BlockIndex<FacePlace> face_index_;
  bool has_splits_ = false, has_colors_ = false;
  double full_color_ = 1;
  UsedMaterials materials_;
  std::vector<Library> libraries_;
  WarningList warnings_;
};

}  // namespace voxdag::obj
