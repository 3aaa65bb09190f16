// The cursor of a scene of points. It reads blocks of points, snaps and checks them, and makes
// their triangles.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "scene/points/point_file.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::points {

struct PointOptions {
  double radius = 0;  // half edge of a point's cube; 0: each point is one degenerate triangle
  bool skip_invalid = false;
};

// Returns the number of triangles of one point.
uint64_t triangles_of_point(const PointOptions& options);

class PointCursor : public TriangleCursor {
 public:
  // `cursors` is the number of cursors that share the budget. All references must outlive the
  // cursor.
  PointCursor(const PointFile& points, const PointOptions& options, unsigned cursors,
              MemoryBudget& budget, const CancelToken& cancel);

  void read(uint64_t first, uint64_t count, const Visitor& visit) override;
  void read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                    const Visitor& visit) override;
  void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) override;
  WorldBounds read_bounds(uint64_t first, uint64_t count) override;

 private:
  static constexpr uint64_t kBlockPoints = 1024;
  static constexpr uint64_t kNoBlock = ~uint64_t{0};

  template <class T, class VisitBatch>
  void read_placed(uint64_t first, uint64_t count, const Grid* grid, PageBuffer<T>& batch,
                   const VisitBatch& visit);
  template <class T>
  size_t place(uint64_t point, uint64_t first, uint64_t end, const Grid* grid, T* out);
  // Reads the block of a point, if it is not the current block, and returns the number of the first
  // point after the block.
  uint64_t load_block(uint64_t point);
  void load_colors();
  bool is_valid(uint64_t point, const double* low, const double* high);
  void set_color(uint64_t, RealTriangle&) {}
  void set_color(uint64_t point, SurfaceTriangle& triangle);

  const PointFile& points_;
  const PointOptions options_;
  const uint64_t per_point_;  // triangles of one point
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const std::unique_ptr<PointReader> reader_;
  PageBuffer<double> positions_;           // positions of the points of block_
  PageBuffer<PointReader::Color> colors_;  // colors of the points of color_block_
  uint64_t block_ = kNoBlock, color_block_ = kNoBlock;
  PageBuffer<RealTriangle> batch_;
  PageBuffer<SurfaceTriangle> surfaces_;  // allocated by the first read_surfaces()
};

}  // namespace voxdag::points
