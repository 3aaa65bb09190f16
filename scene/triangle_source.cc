#include "scene/triangle_source.h"

namespace voxdag {

void TriangleCursor::read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                                  const Visitor& visit) {
  std::vector<SnappedTriangle> snapped;
  read(first, count, [&](std::span<const WorldTriangle> batch) {
    snapped.assign(batch.begin(), batch.end());
    for (SnappedTriangle& triangle : snapped)
      for (auto& vertex : triangle.v) snap_vertices(grid, vertex);
    visit(snapped);
  });
}

void TriangleCursor::read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) {
  std::vector<SurfaceTriangle> surfaces;
  read(first, count, [&](std::span<const WorldTriangle> batch) {
    surfaces.assign(batch.size(), SurfaceTriangle{});
    for (size_t i = 0; i < batch.size(); ++i) surfaces[i].position = batch[i];
    visit(surfaces);
  });
}

WorldBounds TriangleCursor::read_bounds(uint64_t first, uint64_t count) {
  WorldBounds bounds;
  read(first, count, [&](std::span<const WorldTriangle> batch) { bounds.add(bounds_of(batch)); });
  return bounds;
}

}  // namespace voxdag
