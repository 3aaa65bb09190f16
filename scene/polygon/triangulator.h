// Divides the polygons of scene files into triangles. A polygon of n corners always gives n - 2
// triangles. The triangles depend only on the coordinates of the corners, in their order.
//
// 1. The polygon is projected to a coordinate plane (projection.h).
// 2. If the fan (c0, c(k), c(k+1)) around the first corner has no clockwise triangle in the plane,
//    the triangles are this fan. This holds for every convex polygon. Clockwise triangles that the
//    rounding of the coordinates can explain are ignored.
// 3. Otherwise, each corner that is collinear with its two neighbors is removed, and the degenerate
//    triangle of these three corners is added. The rest is divided into monotone rings (sweep.h),
//    and these into triangles (monotone.h).
// 4. Exact tests prove that no triangle is clockwise. So the triangles cover exactly the points
//    that the polygon goes around, whatever its shape.
// 5. If a triangle is clockwise, or if there is no such division because edges cross each other,
//    the polygon is doubtful. A doubtful polygon becomes its fan, which covers at least the points
//    of step 4.
//
// A polygon with a coordinate that is not finite becomes its fan. Takes O(n log n) comparisons, and
// up to kBytesPerCorner of memory per corner. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "scene/growing_charge.h"
#include "scene/polygon/sweep.h"

namespace voxdag::polygon {

// Returns the position in a polygon of corner `k` of a triangle. `split` has three positions for
// each triangle. If it is empty, the triangles are the fan of the polygon.
inline size_t position_of_corner(std::span<const uint32_t> split, size_t triangle, size_t k) {
  if (!split.empty()) return split[3 * triangle + k];
  return k == 0 ? 0 : triangle + k;
}

// Returns the warning that `count` polygons are doubtful. `edges` is the subject of its message,
// such as "its edges".
inline Warning crossing_edges(std::string place, const std::string& edges, uint64_t count) {
  return {"crossing-edges", std::move(place),
          edges + " cross each other, so its area is doubtful; it is read as a fan", count};
}

class Triangulator {
 public:
  static constexpr uint64_t kBytesPerCorner = 160;

  // `what` names the polygons in an out-of-memory message. The budget must outlive this object.
  Triangulator(MemoryBudget& budget, std::string what) : charge_(budget, std::move(what)) {}

  // Triangulates a polygon of at least three corners. `xyz` has three coordinates per corner, and
  // may be changed. Returns false if the triangles are the fan; then triangles() is not set. Throws
  // Error{kOutOfMemory} if the memory budget is too small for the corners.
  bool triangulate(std::span<double> xyz);

  // Returns the triangles: the numbers of three corners for each.
  std::span<const uint32_t> triangles() const { return triangles_; }
  // True if the last polygon was doubtful: its edges cross, or a triangle would be clockwise.
  bool is_doubtful() const { return is_doubtful_; }

 private:
  bool triangulate_projected();
  void remove_collinear_corners();
  bool triangulate_kept(Sweep::Move move);

  GrowingCharge charge_;
  std::vector<Point> points_;   // all corners in the plane
  std::vector<uint32_t> kept_;  // the corners that step 3 does not remove
  std::vector<Point> kept_points_;
  std::vector<uint32_t> ring_;
  std::vector<bool> is_visited_;
  std::vector<uint32_t> triangles_;
  Sweep sweep_;
  bool is_doubtful_ = false;
};

}  // namespace voxdag::polygon
