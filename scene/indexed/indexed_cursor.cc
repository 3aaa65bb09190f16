#include "scene/indexed/indexed_cursor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "scene/messages.h"

namespace voxdag {
namespace {

constexpr size_t kBatchTriangles = 1024;
// Triangles per window when bounds are computed. A vertex that several triangles of a window share
// is read once, if the window's vertex indices are close together.
constexpr size_t kWindowTriangles = 4096;

RealTriangle& position_of(RealTriangle& triangle) { return triangle; }
RealTriangle& position_of(SurfaceTriangle& triangle) { return triangle.position; }

}  // namespace

IndexedCursor::IndexedCursor(std::unique_ptr<IndexedMesh> mesh, bool skip_invalid, unsigned cursors,
                             MemoryBudget& budget, const CancelToken& cancel)
    : mesh_(std::move(mesh)),
      skip_invalid_(skip_invalid),
      cursors_(cursors),
      budget_(budget),
      cancel_(cancel),
      vertex_count_(mesh_->positions().count()),
      cache_(budget, vertex_count_, cursors),
      corners_(3 * kWindowTriangles),
      placed_(kBatchTriangles),
      batch_(budget, kBatchTriangles, "a batch of triangles") {
  cache_.bind(mesh_->positions());
}

void IndexedCursor::read(uint64_t first, uint64_t count, const Visitor& visit) {
  read_placed(first, count, nullptr, batch_, visit);
}

void IndexedCursor::read_snapped(uint64_t first, uint64_t count, const Grid& grid,
                                 const Visitor& visit) {
  read_placed(first, count, &grid, batch_, visit);
}

void IndexedCursor::read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) {
  if (!is_white_ && surfaces_.size() == 0) {
    is_white_ = !mesh_->open_surfaces(cursors_);
    if (!is_white_)
      surfaces_ = PageBuffer<SurfaceTriangle>(budget_, kBatchTriangles, "a batch of triangles");
  }
  if (is_white_) return TriangleCursor::read_surfaces(first, count, visit);
  read_placed(first, count, nullptr, surfaces_, visit);
}

WorldBounds IndexedCursor::read_bounds(uint64_t first, uint64_t count) {
  WorldBounds bounds;
  cache_.place(Transform{}, nullptr);
  for (const uint64_t end = first + count; first < end;) {
    cancel_.check();
    const uint64_t n = std::min<uint64_t>(end - first, kWindowTriangles);
    mesh_->read_corners(first, n, corners_.data());
    used_vertices_.find({corners_.data(), 3 * static_cast<size_t>(n)});
    if (!used_vertices_.add_to(bounds, cache_, vertex_count_))
      bounds.add(TriangleCursor::read_bounds(first, n));
    first += n;
  }
  return bounds;
}

// Visits triangles [first, first + count) in batches, with vertices snapped to `grid` if it is not
// null. T is RealTriangle or SurfaceTriangle.
template <class T, class VisitBatch>
void IndexedCursor::read_placed(uint64_t first, uint64_t count, const Grid* grid,
                                PageBuffer<T>& batch, const VisitBatch& visit) {
  cache_.place(Transform{}, grid);
  for (const uint64_t end = first + count; first < end;) {
    cancel_.check();
    const uint64_t n = std::min<uint64_t>(end - first, kBatchTriangles);
    mesh_->read_corners(first, n, corners_.data());
    size_t placed = 0;
    for (uint64_t i = 0; i < n; ++i) {
      const uint32_t* const corners = &corners_[3 * static_cast<size_t>(i)];
      if (place(corners, position_of(batch[placed])))
        placed_[placed++] = static_cast<uint32_t>(i);
      else if (!skip_invalid_)
        report(first + i, corners);
    }
    complete({batch.data(), placed});
    if (placed > 0) visit({batch.data(), placed});
    first += n;
  }
}

void IndexedCursor::complete(std::span<SurfaceTriangle> batch) {
  mesh_->read_surfaces({placed_.data(), batch.size()}, corners_.data(), batch.data());
}

// Sets `out` to the triangle with these vertex indices. Returns false if an index is out of range
// or a vertex is not finite.
bool IndexedCursor::place(const uint32_t* corners, RealTriangle& out) {
  if (std::max({corners[0], corners[1], corners[2]}) >= vertex_count_) return false;
  for (int k = 0; k < 3; ++k) std::copy_n(cache_.at(corners[k]), 3, out.v[k]);
  // If a vertex is not finite, all its coordinates are NaN.
  return cache_.all_finite() ||
         !(std::isnan(out.v[0][0]) || std::isnan(out.v[1][0]) || std::isnan(out.v[2][0]));
}

void IndexedCursor::report(uint64_t triangle, const uint32_t* corners) {
  const std::string where = mesh_->place_of(triangle) + ": ";
  for (int k = 0; k < 3; ++k)
    if (corners[k] >= vertex_count_)
      refuse(mesh_->path(), where + mesh_->name_index(triangle, k, corners[k]) +
                                " does not exist, there are " + std::to_string(vertex_count_) +
                                " vertices");
  for (int k = 0; k < 3; ++k)
    if (std::isnan(cache_.at(corners[k])[0]))
      refuse(mesh_->path(), where + mesh_->name_vertex(corners[k]) + not_finite());
  refuse(mesh_->path(), where + "a vertex" + not_finite());
}

}  // namespace voxdag
