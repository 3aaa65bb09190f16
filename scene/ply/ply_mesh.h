// The triangles of a PLY file with their positions and surfaces. Not thread-safe.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "scene/indexed/block_cache.h"
#include "scene/indexed/indexed_mesh.h"
#include "scene/ply/face_reader.h"
#include "scene/ply/ply_file.h"
#include "scene/ply/rows/strip_reader.h"
#include "scene/ply/surfaces.h"
#include "scene/ply/vertex_reader.h"

namespace voxdag::ply {

class PlyMesh : public IndexedMesh {
 public:
  // The file must have triangles. The references must outlive the mesh. `cursors` is the number of
  // cursors that share the budget.
  PlyMesh(const PlyFile& ply, Surfaces& surfaces, unsigned cursors, MemoryBudget& budget);

  const std::string& path() const override { return ply_.file().path(); }
  PositionSource& positions() override { return vertices_; }
  void read_corners(uint64_t first, uint64_t count, uint32_t* corners) override;
  bool open_surfaces(unsigned cursors) override;
  void read_surfaces(std::span<const uint32_t> numbers, const uint32_t* corners,
                     SurfaceTriangle* out) override;
  std::string place_of(uint64_t triangle) override;

 private:
  using Pair = std::array<double, 2>;

  // Reads properties of vertices, and caches the values that they are converted to.
  template <class Value>
  struct Cached {
    VertexReader reader;
    std::vector<double> numbers;
    BlockCache<Value> cache;
  };

  void read_strips(uint64_t first, uint64_t count, uint32_t* corners);
  bool read_texture(size_t number, const uint32_t* vertices, SurfaceTriangle& out);
  bool find_texcoords(size_t number, const uint32_t* vertices, std::array<double, 6>& out);
  size_t texture_of(size_t number) const;
  void read_colors(size_t number, const uint32_t* vertices, SurfaceTriangle& out);
  const Color& color_of(uint32_t vertex);
  const Pair& texcoords_of(uint32_t vertex);

  const PlyFile& ply_;
  Surfaces& surfaces_;
  MemoryBudget& budget_;
  VertexReader vertices_;
  std::optional<FaceReader> faces_;
  std::optional<StripReader> strips_;
  uint64_t next_strip_triangle_ = UINT64_MAX;  // the triangle at the position of strips_

  const Surfaces::Values* values_ = nullptr;  // set by open_surfaces()
  std::optional<Cached<Color>> colors_;
  std::optional<Cached<Pair>> texcoords_;
  // Results of the last read_corners(): the number of triangles from faces, and their values.
  size_t face_triangles_ = 0;
  FaceReader::Surfaces face_values_;
};

}  // namespace voxdag::ply
