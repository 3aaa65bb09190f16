// The descent of one ray through the DAG.
//
// The ray is mirrored so that its direction is positive on every axis. `out` has, by axis, the
// ray's parameters at the three planes at which the ray can leave a cell. A ray that enters the
// cell at `t` leaves it at the smallest of the three. The parameter at a plane is always computed
// from the plane's integer coordinate by the same formula. So a descent can begin in any cell that
// the ray enters, with the same result as from the root.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "query/dag/dag_view.h"
#include "query/dag/vec.h"
#include "query/rays/ray_caster.h"

namespace voxdag::query {

// A copy of a ray, mirrored so that its direction is positive on every axis.
struct MirroredRay {
  // A component of a direction whose magnitude is less than this number is replaced by this number.
  // Otherwise, the inverse of the component could be infinite.
  static constexpr double kMinComponent = 1e-18;

  static double component(double d) { return std::max(std::fabs(d), kMinComponent); }

  MirroredRay() = default;
  MirroredRay(const Ray& ray, double resolution) {
    for (int axis = 0; axis < 3; ++axis) {
      const double d = ray.direction[axis];
      inverse[axis] = 1 / component(d);
      origin[axis] = ray.origin[axis];
      if (d >= 0) continue;
      mirror |= 4 >> axis;
      origin[axis] = resolution - ray.origin[axis];
    }
  }
  double time_of(int axis, double plane) const { return (plane - origin[axis]) * inverse[axis]; }

  double origin[3], inverse[3];
  int mirror = 0;  // bits of a child index, set for the axes on which the ray was mirrored
};

class RayWalk {
 public:
  // `max_steps`: maximum number of nodes and bricks to read. After this number, the walk ends
  // without a hit.
  RayWalk(const DagView& dag, const MirroredRay& ray, const Cone& cone, double t_max,
          uint64_t max_steps = ~uint64_t{0})
      : dag_(dag), ray_(ray), cone_(cone), t_max_(t_max), steps_left_(max_steps) {}

  uint64_t steps_left() const { return steps_left_; }

  // Walks from the root. Returns true and sets `hit` if the ray hits a cell. The DAG must not be
  // empty. Throws Error{kCorrupt} for a damaged DAG.
  bool run(double t_min, Hit& hit);
  // Walks from a cell that has children. `low` is the cell's low corner, mirrored like the ray, and
  // `size` the cell's edge, both in voxels. `content` is the cell's content as in DagView. `axis`
  // is the axis of the face through which the ray enters the cell at `t`; -1 if the ray begins in
  // the cell.
  bool run_below(uint32_t depth, const double (&low)[3], double size, uint64_t content,
                 const double (&out)[3], double t, int axis, Hit& hit) {
    axis_ = axis;
    if (size <= cone_.at(t)) return report(depth, low, size, t, hit);
    return enter(depth, low, size / 2, content, out, t, hit);
  }

 private:
  // Visits the children of a cell that the ray crosses, nearest first. Leaves out the children for
  // which has(index) is false. Calls enter_child(index, low corner, out, t) for each child, until
  // enter_child() returns true, which means a hit. Returns true after a hit.
  template <class Has, class EnterChild>
  bool cross(const double (&low)[3], double half, const double (&out)[3], double t, const Has& has,
             const EnterChild& enter_child);
  bool enter(uint32_t depth, const double (&low)[3], double half, uint64_t content,
             const double (&out)[3], double t, Hit& hit);
  bool enter_brick(uint64_t mask, const double (&low)[3], const double (&out)[3], double t,
                   Hit& hit);
  bool report(uint32_t depth, const double (&low)[3], double size, double t, Hit& hit) const;

  const DagView& dag_;
  const MirroredRay ray_;
  const Cone cone_;
  double t_max_;
  uint64_t steps_left_;
  int axis_ = -1;
};

}  // namespace voxdag::query
