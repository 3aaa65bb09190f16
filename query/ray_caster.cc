#include "query/ray_caster.h"

#include <algorithm>

namespace voxdag::query {
namespace {

// A smaller component of a direction counts as 0; its inverse could be infinite.
constexpr double kMinComponent = 1e-18;

// The descent of one ray.
class Walk {
 public:
  Walk(const DagView& dag, const Ray& ray, const Cone& cone, double t_max)
      : dag_(dag), cone_(cone), t_max_(t_max) {
    for (int axis = 0; axis < 3; ++axis) {
      const double d = ray.direction[axis];
      inverse_[axis] = 1 / std::max(std::fabs(d), kMinComponent);
      origin_[axis] = ray.origin[axis];
      if (d >= 0) continue;
      mirror_ |= 4 >> axis;
      origin_[axis] = static_cast<double>(dag.resolution()) - ray.origin[axis];
    }
  }

  bool run(double t_min, Hit& hit) {
    const int64_t whole[3] = {0, 0, 0};
    const Vec in = planes(whole, 0), out = planes(whole, dag_.resolution());
    double t = t_min;
    for (int axis = 0; axis < 3; ++axis)
      if (in[axis] > t) {
        t = in[axis];
        axis_ = axis;
      }
    if (t > std::min({out[0], out[1], out[2], t_max_})) return false;
    return enter(0, whole, dag_.root(), t, hit);
  }

 private:
  // The ray parameters at the planes `add` voxels above the corner.
  Vec planes(const int64_t (&corner)[3], int64_t add) const {
    Vec times;
    for (int axis = 0; axis < 3; ++axis)
      times[axis] = (static_cast<double>(corner[axis] + add) - origin_[axis]) * inverse_[axis];
    return times;
  }

  // Visits the mirrored cell with this low corner, which contains the ray at `t`.
  bool enter(uint32_t depth, const int64_t (&corner)[3], uint64_t content, double t, Hit& hit) {
    const int64_t size = dag_.resolution() >> depth;
    if (size == 1 || static_cast<double>(size) <= cone_.at(t)) {
      report(depth, corner, size, t, hit);
      return true;
    }
    const DagView::Children children = dag_.children(depth, content);
    const Vec middle = planes(corner, size / 2), out = planes(corner, size);
    Vec next = middle;
    int index = 0;
    for (int axis = 0; axis < 3; ++axis)
      if (t >= middle[axis]) {
        index |= 4 >> axis;
        next[axis] = out[axis];
      }
    for (;;) {
      if (children.has(index ^ mirror_)) {
        const int64_t half = size / 2;
        const int64_t low[3] = {corner[0] + (index & 4 ? half : 0),
                                corner[1] + (index & 2 ? half : 0),
                                corner[2] + (index & 1 ? half : 0)};
        if (enter(depth + 1, low, dag_.content(depth, children, index ^ mirror_), t, hit))
          return true;
      }
      const int axis =
          next[0] <= next[1] ? (next[0] <= next[2] ? 0 : 2) : (next[1] <= next[2] ? 1 : 2);
      t = next[axis];
      if (index & 4 >> axis || t > t_max_) return false;
      axis_ = axis;
      index |= 4 >> axis;
      next[axis] = out[axis];
    }
  }

  void report(uint32_t depth, const int64_t (&corner)[3], int64_t size, double t, Hit& hit) const {
    hit.t = t;
    hit.depth = depth;
    hit.axis = axis_;
    for (int axis = 0; axis < 3; ++axis) {
      const bool mirrored = mirror_ & 4 >> axis;
      hit.cell[axis] = (mirrored ? dag_.resolution() - size - corner[axis] : corner[axis]) / size;
    }
  }

  const DagView& dag_;
  const Cone cone_;
  const double t_max_;
  double origin_[3], inverse_[3];
  int mirror_ = 0;  // child index bits of the axes on which the ray was mirrored
  int axis_ = -1;
};

}  // namespace

bool RayCaster::cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit) const {
  return !dag_.empty() && Walk(dag_, ray, cone, t_max).run(t_min, hit);
}

}  // namespace voxdag::query
