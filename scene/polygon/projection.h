// The projection of a polygon in space to a coordinate plane, in which it is triangulated.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "scene/polygon/orientation.h"

namespace voxdag::polygon {

// The chosen plane: the coordinate plane in which the triangles (c0, c(k), c(k+1)) of the polygon's
// fan have the largest sum of areas. Of planes with equal sums, it is the first in the order yz,
// zx, xy. In the plane, the signed area of the polygon is positive or 0.
struct Projection {
  int axis = 0;              // the axis that the projection drops
  bool is_mirrored = false;  // the other two axes are exchanged
  // True if no triangle of the fan is clockwise in the plane. The test ignores triangles that can
  // be clockwise only because coordinates are rounded. If is_fan is true, the fan is inside the
  // polygon.
  bool is_fan = false;
};

// A fast test that is enough for most polygons. If it returns true, the triangles of the polygon
// are its fan: choose_projection() would set is_fan, or a coordinate is not finite. If it returns
// false, choose_projection() must decide. `xyz` holds three coordinates per corner and need not be
// normalized.
bool is_clear_fan(std::span<const double> xyz);

// Multiplies the coordinates by a power of two, so that the largest magnitude is from 1/2 to 1.
// `xyz` holds three coordinates per corner. Returns false, and changes nothing, if a coordinate is
// not finite.
bool normalize(std::span<double> xyz);

// Returns the projection of a normalized polygon.
Projection choose_projection(std::span<const double> xyz);

// Replaces `out` by the projected corners.
void project(std::span<const double> xyz, const Projection& projection, std::vector<Point>& out);

}  // namespace voxdag::polygon
