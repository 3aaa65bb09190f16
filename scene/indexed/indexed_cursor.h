// The cursor of a scene that is one indexed mesh. It caches positions, snaps them, checks indices
// and positions, and computes bounds.
#pragma once

#include <memory>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "scene/indexed/indexed_mesh.h"
#include "scene/triangle_source.h"
#include "scene/vertices/used_vertices.h"
#include "scene/vertices/vertex_cache.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class IndexedCursor : public TriangleCursor {
 public:
  // `cursors` is the number of cursors that share the budget. `budget` and `cancel` must outlive
  // the cursor.
  IndexedCursor(std::unique_ptr<IndexedMesh> mesh, bool skip_invalid, unsigned cursors,
                MemoryBudget& budget, const CancelToken& cancel);

  void read(uint64_t first, uint64_t count, const Visitor& visit) override;
  void read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                    const Visitor& visit) override;
  void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) override;
  WorldBounds read_bounds(uint64_t first, uint64_t count) override;

 private:
  template <class T, class VisitBatch>
  void read_placed(uint64_t first, uint64_t count, const Grid* grid, PageBuffer<T>& batch,
                   const VisitBatch& visit);
  void complete(std::span<RealTriangle>) {}
  void complete(std::span<SurfaceTriangle> batch);
  bool place(const uint32_t* corners, RealTriangle& out);
  [[noreturn]] void report(uint64_t triangle, const uint32_t* corners);

  const std::unique_ptr<IndexedMesh> mesh_;
  const bool skip_invalid_;
  const unsigned cursors_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const uint64_t vertex_count_;
  VertexCache cache_;
  std::vector<uint32_t> corners_;
  std::vector<uint32_t> placed_;  // for each triangle of the batch, its number in corners_
  UsedVertices used_vertices_;
  PageBuffer<RealTriangle> batch_;
  PageBuffer<SurfaceTriangle> surfaces_;  // allocated by the first read_surfaces()
  bool is_white_ = false;                 // open_surfaces() returned false: no colors
};

// The cursor of a scene without triangles.
class NoTriangles : public TriangleCursor {
 public:
  void read(uint64_t, uint64_t, const Visitor&) override {}
};

}  // namespace voxdag
