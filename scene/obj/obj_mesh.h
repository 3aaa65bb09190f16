// The triangles of an OBJ file with their positions and surfaces. Not thread-safe.
#pragma once

#include <optional>

#include "scene/indexed/block_cache.h"
#include "scene/indexed/indexed_mesh.h"
#include "scene/obj/file/face_reader.h"
#include "scene/obj/file/obj_file.h"
#include "scene/obj/file/vertex_reader.h"
#include "scene/obj/materials/materials.h"

namespace voxdag::obj {

class ObjMesh : public IndexedMesh {
 public:
  // The file must have triangles. The references must outlive the mesh. `cursors` is the number of
  // cursors that share the budget.
  ObjMesh(const ObjFile& obj, const ObjMaterials& materials, unsigned cursors, MemoryBudget& budget)
      : obj_(obj),
        materials_(materials),
        budget_(budget),
        faces_(obj, cursors, budget),
        positions_(obj, budget) {}

  const std::string& path() const override { return obj_.file().path(); }
  PositionSource& positions() override { return positions_; }
  void read_corners(uint64_t first, uint64_t count, uint32_t* corners) override {
    faces_.read(first, count, corners, has_surfaces_ ? &surfaces_ : nullptr);
  }
  bool open_surfaces(unsigned cursors) override;
  void read_surfaces(std::span<const uint32_t> numbers, const uint32_t* corners,
                     SurfaceTriangle* out) override;
  std::string place_of(uint64_t triangle) override { return faces_.place_of(triangle); }
  std::string name_index(uint64_t triangle, int corner, uint32_t) override {
    return "index " + faces_.index_text(triangle, static_cast<size_t>(corner));
  }
  // Returns the vertex's name with its number in the file, which counts from 1.
  std::string name_vertex(uint32_t index) override {
    return "vertex " + std::to_string(uint64_t{index} + 1);
  }

 private:
  // Caches the values of v or vt statements.
  template <class Reader, class Value>
  class Cached {
   public:
    Cached(const ObjFile& obj, uint64_t count, unsigned cursors, MemoryBudget& budget)
        : reader_(obj, budget), cache_(budget, count, cursors, "the statements of a scene") {}
    const Value& at(uint64_t element) {
      return cache_.at(element, [&](uint64_t first, size_t count, Value* out) {
        reader_.read(first, count, out);
      });
    }

   private:
    Reader reader_;
    BlockCache<Value> cache_;
  };

  void read_material(size_t number, SurfaceTriangle& out);

  const ObjFile& obj_;
  const ObjMaterials& materials_;
  MemoryBudget& budget_;
  FaceReader faces_;
  Positions positions_;
  bool has_surfaces_ = false;
  FaceReader::Surfaces surfaces_;  // surfaces of the triangles of the last read_corners()
  std::optional<Cached<Colors, Colors::Color>> colors_;
  std::optional<Cached<TextureCoordinates, TextureCoordinates::Coordinates>> texcoords_;
};

}  // namespace voxdag::obj
