// Casts rays through the DAG.
//
// A ray descends the octree from the root, at each node through the children that it crosses,
// nearest first. The parameters at which it crosses planes are computed from the planes' integer
// coordinates by one formula: cells on both sides of a plane agree to the last bit, so there are no
// cracks at any resolution. The ray is mirrored so that its direction is positive on every axis.
//
// A ray widens into a cone: an occupied cell that is no larger than the cone's width there
// counts as solid. That ends the descent where finer cells would be invisible.
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
  uint32_t depth = 0;    // levels below the root; the edge of the cell is R / 2^depth voxels
  int64_t cell[3] = {};  // position of the cell, in units of its edge
  int axis = -1;  // normal axis of the face that the ray entered by; -1 if it began in the cell
};

class RayCaster {
 public:
  explicit RayCaster(const DagView& dag) : dag_(dag) {}

  // Finds the first occupied cell between t_min and t_max; false without one. Throws
  // Error{kCorrupt} for a damaged DAG.
  bool cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit) const;
  // The same with at most `steps_left` nodes and bricks, which it lowers by as many as it read. If
  // that becomes 0 the ray ends there, and false means nothing.
  bool cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit,
            uint64_t& steps_left) const;

 private:
  const DagView& dag_;
};

}  // namespace voxdag::query
