#include "query/lookup/overlaps.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/error.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

using Point = std::array<double, 3>;

bool touches(const OverlapBox& box, const Point& low, double edge) {
  for (size_t axis = 0; axis < 3; ++axis)
    if (box.low[axis] >= low[axis] + edge || box.high[axis] <= low[axis]) return false;
  return true;
}

// Returns the signed distance from the interval [low, high] to `at`: negative below the interval, 0
// in it, positive above it.
double excess(double at, double low, double high) {
  return at < low ? at - low : at > high ? at - high : 0;
}

// Computes the distance between the segment of a capsule and a cube. Let t, 0 to 1, be the position
// of a point on the segment. The squared distance of this point from the cube is a convex function
// of t. Its derivative is linear between the positions at which the segment crosses the planes of
// the cube's faces. So the minimum is found exactly: it is where the derivative is 0, or at an end
// of the segment.
class SegmentDistance {
 public:
  SegmentDistance(const Capsule& capsule, const Point& low, double edge)
      : capsule_(capsule), low_(low), edge_(edge) {}

  double squared() const {
    const double t = nearest();
    double sum = 0;
    for (size_t axis = 0; axis < 3; ++axis) sum += excess_at(axis, t) * excess_at(axis, t);
    return sum;
  }

 private:
  double direction(size_t axis) const { return capsule_.to[axis] - capsule_.from[axis]; }
  double excess_at(size_t axis, double t) const {
    return excess(capsule_.from[axis] + t * direction(axis), low_[axis], low_[axis] + edge_);
  }
  // Returns half the derivative of the squared distance at t.
  double slope(double t) const {
    double sum = 0;
    for (size_t axis = 0; axis < 3; ++axis) sum += direction(axis) * excess_at(axis, t);
    return sum;
  }
  double nearest() const {
    if (slope(0) >= 0) return 0;
    if (slope(1) <= 0) return 1;
    std::array<double, 8> ts = {0, 1, 1, 1, 1, 1, 1, 1};
    for (size_t axis = 0; axis < 3; ++axis)
      for (size_t side = 0; side < 2; ++side) {
        const double plane = low_[axis] + static_cast<double>(side) * edge_;
        const double t = (plane - capsule_.from[axis]) / direction(axis);
        if (t > 0 && t < 1) ts[1 + 2 * axis + side] = t;
      }
    std::ranges::sort(ts);
    for (size_t i = 0; i + 1 < ts.size(); ++i) {
      const double begin = slope(ts[i]), end = slope(ts[i + 1]);
      if (end < 0) continue;
      return end == begin ? ts[i] : ts[i] + (ts[i + 1] - ts[i]) * -begin / (end - begin);
    }
    return 1;
  }

  const Capsule& capsule_;
  const Point low_;
  const double edge_;
};

bool touches(const Capsule& capsule, const Point& low, double edge) {
  return SegmentDistance(capsule, low, edge).squared() < capsule.radius * capsule.radius;
}

// Searches for a set cell that overlaps a shape. Skips cubes that do not overlap it.
template <class Shape>
class OverlapSearch {
 public:
  OverlapSearch(const DagView& dag, uint32_t grid_levels, const Shape& shape)
      : dag_(dag), grid_levels_(grid_levels), shape_(shape) {}

  bool run() const {
    return !dag_.empty() &&
           visit(0, dag_.root(), {0, 0, 0}, static_cast<double>(dag_.resolution()));
  }

 private:
  bool visit(uint32_t depth, uint64_t content, const Point& low, double edge) const {
    if (!touches(shape_, low, edge)) return false;
    if (depth == grid_levels_) return true;
    const DagView::Children children = dag_.children(depth, content);
    const double half = edge / 2;
    for (int i = 0; i < 8; ++i) {
      if (!children.has(i)) continue;
      const Point corner = {low[0] + (i & 4 ? half : 0), low[1] + (i & 2 ? half : 0),
                            low[2] + (i & 1 ? half : 0)};
      if (visit(depth + 1, dag_.content(depth, children, i), corner, half)) return true;
    }
    return false;
  }

  const DagView& dag_;
  const uint32_t grid_levels_;
  const Shape& shape_;
};

// Throws Error{kInvalidInput} unless the number is finite. `name` names the number in the message.
void expect_finite(const std::string& name, double number) {
  if (!std::isfinite(number))
    throw Error(ErrorCode::kInvalidInput,
                name + " is " + std::to_string(number) + ": expected a finite number");
}
void expect_finite(const std::string& name, const Point& point) {
  for (size_t axis = 0; axis < 3; ++axis)
    expect_finite(name + "[" + std::to_string(axis) + "]", point[axis]);
}

}  // namespace

bool overlaps(const DagView& dag, uint32_t grid_levels, const OverlapBox& box) {
  check_grid_levels(dag, grid_levels);
  expect_finite("the box's low", box.low);
  expect_finite("the box's high", box.high);
  return OverlapSearch<OverlapBox>(dag, grid_levels, box).run();
}

bool overlaps(const DagView& dag, uint32_t grid_levels, const Capsule& capsule) {
  check_grid_levels(dag, grid_levels);
  expect_finite("the capsule's from", capsule.from);
  expect_finite("the capsule's to", capsule.to);
  expect_finite("the capsule's radius", capsule.radius);
  return OverlapSearch<Capsule>(dag, grid_levels, capsule).run();
}

}  // namespace voxdag::query
