// Casts rays through the DAG.
//
// A ray descends the octree from the root. At each node it descends into the children that it
// crosses, nearest first. A ray's parameter t at a plane is the distance along the ray from its
// origin to the plane. The parameter is computed from the plane's integer coordinate, always by the
// same formula. So the cells on both sides of a plane get the same t to the last bit, and there are
// no cracks at any resolution. The ray is mirrored so that its direction is positive on every axis.
//
// A ray can widen into a cone. An occupied cell that is no larger than the width of the cone at the
// cell counts as solid. So the descent ends where finer cells would be invisible.
//
// Immutable; any number of threads may cast rays.
#pragma once

#include <cstdint>

#include "query/dag/dag_view.h"
#include "query/dag/vec.h"

namespace voxdag::query {

struct Cone {
  double width = 0;   // at t = 0, in voxels
  double spread = 0;  // growth of the width with t
  double at(double t) const { return width + spread * t; }
};

struct Hit {
  double t = 0;
  uint32_t depth = 0;    // levels below the root; the cell's edge is the grid's edge / 2^depth
  int64_t cell[3] = {};  // position of the cell, in units of its edge
  // Axis of the normal of the face through which the ray entered the cell; -1 if the ray began in
  // the cell.
  int axis = -1;
};

class RayCaster {
 public:
  explicit RayCaster(const DagView& dag) : dag_(dag) {}

  // Finds the first occupied cell between t_min and t_max. Returns false if none exists. Throws
  // Error{kCorrupt} for a damaged DAG.
  bool cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit) const;
  // Like the other cast(), but reads at most `steps_left` nodes and bricks, and subtracts the
  // number of reads from `steps_left`. If `steps_left` is then 0, it is possible that the search
  // ended early, and a result of false does not mean that there is no hit.
  bool cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit,
            uint64_t& steps_left) const;
  // True if an occupied cell exists between t_min and t_max, so if cast() would find a hit. Throws
  // Error{kCorrupt} for a damaged DAG.
  bool occluded(const Ray& ray, const Cone& cone, double t_min, double t_max) const {
    Hit unused;
    return cast(ray, cone, t_min, t_max, unused);
  }

 private:
  const DagView& dag_;
};

}  // namespace voxdag::query
