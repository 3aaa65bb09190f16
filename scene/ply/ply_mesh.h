// The triangles of a PLY file with their positions and colors. Not thread-safe.
#pragma once

#include <optional>

#include "scene/indexed/indexed_mesh.h"
#include "scene/ply/face_reader.h"
#include "scene/ply/ply_file.h"
#include "scene/ply/vertex_colors.h"
#include "scene/ply/vertex_reader.h"

namespace voxdag::ply {

class PlyMesh : public IndexedMesh {
 public:
  // The file must have faces. It and the budget must outlive the mesh.
  PlyMesh(const PlyFile& ply, MemoryBudget& budget)
      : ply_(ply), budget_(budget), faces_(ply, budget), vertices_(ply, ply.axes(), budget) {}

  const std::string& path() const override { return ply_.file().path(); }
  PositionSource& positions() override { return vertices_; }
  void read_corners(uint64_t first, uint64_t count, uint32_t* corners) override {
    faces_.read(first, count, corners);
  }
  bool open_surfaces(unsigned cursors) override {
    if (!ply_.colors().empty()) colors_.emplace(ply_, cursors, budget_);
    return colors_.has_value();
  }
  void read_surfaces(std::span<const uint32_t> numbers, const uint32_t* corners,
                     SurfaceTriangle* out) override;
  std::string place_of(uint64_t triangle) override {
    return "face " + std::to_string(faces_.face_of(triangle));
  }

 private:
  const PlyFile& ply_;
  MemoryBudget& budget_;
  FaceReader faces_;
  VertexReader vertices_;
  std::optional<VertexColors> colors_;
};

}  // namespace voxdag::ply
