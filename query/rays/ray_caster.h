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
  // Normal axis of the face by which the ray entered; -1 if the ray began in the cell.
  int axis = -1;
};

class RayCaster {
 public:
  explicit RayCaster(const DagView& dag) : dag_(dag) {}

  // Finds the first occupied cell between t_min and t_max. Returns false if none exists. Throws
  // Error{kCorrupt} for a damaged DAG.
  bool cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit) const;
  // Like the above, but reads at most `steps_left` nodes and bricks, and subtracts the number read.
  // If the rest is 0, the ray ended early, and false does not mean that there is no hit.
  bool cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit,
            uint64_t& steps_left) const;

 private:
  const DagView& dag_;
};

}  // namespace voxdag::query
