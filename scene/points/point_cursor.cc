#include "scene/points/point_cursor.h"

#include <algorithm>
#include <cmath>

#include "scene/messages.h"
#include "scene/points/cube.h"

namespace voxdag::points {
namespace {

// Maximum number of triangles in a batch. A batch has all triangles of a point or none, except for
// the first and last point of a call.
constexpr size_t kPointBatch = 1024;

RealTriangle& triangle_in(RealTriangle& triangle) { return triangle; }
RealTriangle& triangle_in(SurfaceTriangle& triangle) { return triangle.position; }

bool are_finite(const double* values) {
  return std::isfinite(values[0]) && std::isfinite(values[1]) && std::isfinite(values[2]);
}

}  // namespace

uint64_t triangles_of_point(const PointOptions& options) {
  return options.radius > 0 ? kCubeTriangles : 1;
}

PointCursor::PointCursor(const PointFile& points, const PointOptions& options, unsigned cursors,
                         MemoryBudget& budget, const CancelToken& cancel)
    : points_(points),
      options_(options),
      per_point_(triangles_of_point(options)),
      budget_(budget),
      cancel_(cancel),
      reader_(points.open(cursors, budget)),
      positions_(budget, 3 * kBlockPoints, "a block of points"),
      batch_(budget, kPointBatch, "a batch of triangles") {}

void PointCursor::read(uint64_t first, uint64_t count, const Visitor& visit) {
  read_placed(first, count, nullptr, batch_, visit);
}

void PointCursor::read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                               const Visitor& visit) {
  read_placed(first, count, &grid, batch_, visit);
}

void PointCursor::read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) {
  if (!points_.has_colors()) return TriangleCursor::read_surfaces(first, count, visit);
  if (surfaces_.size() == 0) {
    colors_ = PageBuffer<PointReader::Color>(budget_, kBlockPoints, "a block of colors");
    surfaces_ = PageBuffer<SurfaceTriangle>(budget_, kPointBatch, "a batch of triangles");
  }
  read_placed(first, count, nullptr, surfaces_, visit);
}

WorldBounds PointCursor::read_bounds(uint64_t first, uint64_t count) {
  if (per_point_ != 1) return TriangleCursor::read_bounds(first, count);
  WorldBounds bounds;
  for (const uint64_t end = first + count; first < end;) {
    cancel_.check();
    const uint64_t block_end = std::min(end, load_block(first));
    for (; first < block_end; ++first) {
      const double* const at = &positions_[3 * static_cast<size_t>(first % kBlockPoints)];
      if (!is_valid(first, at, at)) continue;
      bounds.add({{at[0], at[1], at[2]}, {at[0], at[1], at[2]}, false});
    }
  }
  return bounds;
}

// Visits triangles [first, first + count) in batches, with vertices snapped to `grid` if it is not
// null. T is RealTriangle or SurfaceTriangle.
template <class T, class VisitBatch>
void PointCursor::read_placed(uint64_t first, uint64_t count, const Grid* grid,
                              PageBuffer<T>& batch, const VisitBatch& visit) {
  const uint64_t end = first + count;
  while (first < end) {
    cancel_.check();
    const uint64_t block_end = load_block(first / per_point_);
    if constexpr (std::is_same_v<T, SurfaceTriangle>) load_colors();
    size_t placed = 0;
    while (first < end && first / per_point_ < block_end && placed + per_point_ <= kPointBatch) {
      const uint64_t point = first / per_point_;
      const uint64_t point_end = std::min(end, (point + 1) * per_point_);
      placed += place(point, first, point_end, grid, batch.data() + placed);
      first = point_end;
    }
    if (placed > 0) visit({batch.data(), placed});
  }
}

// Writes triangles [first, end), which belong to `point`, to `out`. Returns their number, which is
// 0 if the point is invalid.
template <class T>
size_t PointCursor::place(uint64_t point, uint64_t first, uint64_t end, const Grid* grid, T* out) {
  const double* const at = &positions_[3 * static_cast<size_t>(point % kBlockPoints)];
  if (per_point_ == 1) {
    if (!is_valid(point, at, at)) return 0;
    RealTriangle& triangle = triangle_in(*out);
    std::copy_n(at, 3, triangle.v[0]);
    if (grid) snap_vertices(*grid, triangle.v[0]);
    std::copy_n(triangle.v[0], 3, triangle.v[1]);
    std::copy_n(triangle.v[0], 3, triangle.v[2]);
    set_color(point, *out);
    return 1;
  }
  double box[2][3];  // low and high corner
  for (size_t a = 0; a < 3; ++a) {
    box[0][a] = at[a] - options_.radius;
    box[1][a] = at[a] + options_.radius;
  }
  if (!is_valid(point, box[0], box[1])) return 0;
  if (grid) snap_vertices(*grid, {&box[0][0], 6});
  for (uint64_t i = first; i < end; ++i, ++out) {
    triangle_in(*out) = cube_triangle(box[0], box[1], static_cast<size_t>(i % per_point_));
    set_color(point, *out);
  }
  return static_cast<size_t>(end - first);
}

uint64_t PointCursor::load_block(uint64_t point) {
  const uint64_t block = point / kBlockPoints, first = block * kBlockPoints;
  const uint64_t end = std::min(first + kBlockPoints, points_.count());
  if (block_ == block) return end;
  block_ = kNoBlock;
  reader_->read(first, static_cast<size_t>(end - first), positions_.data());
  block_ = block;
  return end;
}

// Reads the colors of the points in block_, the current block, unless they are already read.
void PointCursor::load_colors() {
  if (color_block_ == block_) return;
  color_block_ = kNoBlock;
  const uint64_t first = block_ * kBlockPoints;
  const uint64_t count = std::min(kBlockPoints, points_.count() - first);
  reader_->read_colors(first, static_cast<size_t>(count), colors_.data());
  color_block_ = block_;
}

// Returns false for a point that skip_invalid drops. Throws Error for any other invalid point.
bool PointCursor::is_valid(uint64_t point, const double* low, const double* high) {
  if (are_finite(low) && are_finite(high)) return true;
  if (!options_.skip_invalid) refuse(points_.file().path(), reader_->fault_of(point));
  return false;
}

void PointCursor::set_color(uint64_t point, SurfaceTriangle& triangle) {
  const PointReader::Color& color = colors_[static_cast<size_t>(point % kBlockPoints)];
  triangle.material = 0;
  triangle.is_flipped = false;
  for (SurfaceCorner& corner : triangle.corners) corner = {{}, color};
}

}  // namespace voxdag::points
