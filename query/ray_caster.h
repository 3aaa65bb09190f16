// Casts rays through the DAG.
//
// A ray walks the octree from the root, at each node through the children that it crosses, nearest
// first. The parameters at which it crosses planes are computed from the planes' integer
// coordinates, by one formula: cells on both sides of a plane agree on it to the last bit, so there
// are no cracks, whatever the resolution. The ray is mirrored so that it runs upwards on every
// axis.
//
// A ray widens into a cone: a cell that is no larger than the cone is there is solid if it is
// occupied at all. That ends the walk where finer cells could not be seen.
#pragma once

#include <cstdint>

#include "query/dag_view.h"
#include "query/vec.h"

namespace voxdag::query {

struct Cone {
  double width = 0;   // at t = 0, in voxels
  double spread = 0;  // growth of the width with t
  double at(double t) const { return width + spread * t; }
};

struct Hit {
  double t = 0;
  uint32_t depth = 0;    // of the cell below the root; its edge is R / 2^depth voxels
  int64_t cell[3] = {};  // its position, in cells
  int axis = -1;         // of the plane through which it was entered; -1: the ray began in it
};

class RayCaster {
 public:
  explicit RayCaster(const DagView& dag) : dag_(dag) {}

  // The first occupied cell between t_min and t_max; false if there is none.
  bool cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit) const;

 private:
  const DagView& dag_;
};

}  // namespace voxdag::query
