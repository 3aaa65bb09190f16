#include "query/rays/ray_walk.h"

#include <limits>

namespace voxdag::query {

bool RayWalk::run(double t_min, Hit& hit) {
  const double edge = static_cast<double>(dag_.resolution());
  const double low[3] = {0, 0, 0};
  double out[3], t = t_min;
  int entered_by = -1;
  for (int axis = 0; axis < 3; ++axis) {
    const double in = ray_.time_of(axis, 0);
    out[axis] = ray_.time_of(axis, edge);
    if (in > t) {
      t = in;
      entered_by = axis;
    }
  }
  if (t > std::min({out[0], out[1], out[2], t_max_})) return false;
  return run_below(0, low, edge, 0, out, t, entered_by, hit);
}

template <class Has, class EnterChild>
inline bool RayWalk::cross(const double (&low)[3], double half, const double (&out)[3], double t,
                           const Has& has, const EnterChild& enter_child) {
  double next[3];  // parameters at which the ray leaves the child, by axis
  int index = 0;   // mirrored index of the child
  for (int axis = 0; axis < 3; ++axis) {
    const double middle = ray_.time_of(axis, low[axis] + half);
    const bool upper = t >= middle;
    next[axis] = upper ? out[axis] : middle;
    index |= upper ? 4 >> axis : 0;
  }
  for (;;) {
    if (has(index ^ ray_.mirror)) {
      const double corner[3] = {index & 4 ? low[0] + half : low[0],
                                index & 2 ? low[1] + half : low[1],
                                index & 1 ? low[2] + half : low[2]};
      if (enter_child(index ^ ray_.mirror, corner, next, t)) return true;
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

bool RayWalk::enter(uint32_t depth, const double (&low)[3], double half, uint64_t content,
                    const double (&out)[3], double t, Hit& hit) {
  if (steps_left_ == 0) {
    t_max_ = -std::numeric_limits<double>::infinity();  // also ends the walk in the cells above
    return false;
  }
  --steps_left_;
  if (depth + 2 == dag_.grid_levels()) return enter_brick(dag_.brick(content), low, out, t, hit);
  const DagView::Children children = dag_.children_of_node(depth, content);
  return cross(
      low, half, out, t, [&](int index) { return children.has(index); },
      [&](int index, const double(&corner)[3], const double(&child_out)[3], double child_t) {
        if (half <= cone_.at(child_t)) return report(depth + 1, corner, half, child_t, hit);
        return enter(depth + 1, corner, half / 2, dag_.offset(children, index), child_out, child_t,
                     hit);
      });
}

// Casts the ray in the octants of a brick and in their voxels.
bool RayWalk::enter_brick(uint64_t mask, const double (&low)[3], const double (&out)[3], double t,
                          Hit& hit) {
  const uint32_t voxel_depth = dag_.grid_levels();
  const auto octant_at = [&](int index) {
    return static_cast<uint32_t>(mask >> (8 * index)) & 255;
  };
  return cross(
      low, 2, out, t, [&](int index) { return octant_at(index) != 0; },
      [&](int index, const double(&corner)[3], const double(&child_out)[3], double child_t) {
        if (2 <= cone_.at(child_t)) return report(voxel_depth - 1, corner, 2, child_t, hit);
        const uint32_t octant = octant_at(index);
        return cross(
            corner, 1, child_out, child_t, [&](int voxel) { return octant >> voxel & 1; },
            [&](int, const double(&voxel)[3], const double(&)[3], double voxel_t) {
              return report(voxel_depth, voxel, 1, voxel_t, hit);
            });
      });
}

bool RayWalk::report(uint32_t depth, const double (&low)[3], double size, double t,
                     Hit& hit) const {
  hit.t = t;
  hit.depth = depth;
  hit.axis = axis_;
  for (int axis = 0; axis < 3; ++axis) {
    const bool mirrored = ray_.mirror & 4 >> axis;
    const double corner =
        mirrored ? static_cast<double>(dag_.resolution()) - size - low[axis] : low[axis];
    hit.cell[axis] = static_cast<int64_t>(corner) >> (dag_.grid_levels() - depth);
  }
  return true;
}

}  // namespace voxdag::query
