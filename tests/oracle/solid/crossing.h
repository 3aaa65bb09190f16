// Decides whether a triangle crosses a row, which is a line along an axis. Every point p of a row
// is moved by (e, e^2, e^3) for an infinitely small e > 0. The oracle computes with polynomials in
// e, so it needs no rules for ties: the sign of a polynomial is the sign of its first coefficient
// that is not 0.
#pragma once

#include "tests/oracle/triangle.h"

namespace oracle {

struct Crossing {
  bool exists = false;     // the triangle crosses the row
  bool is_before = false;  // the crossing is before p on the row
  int sign = 0;            // +1 where a ray along the axis enters the solid
};

// Returns the crossing of a triangle with the row along `axis` through p. Coordinates of vertices
// are odd, at most kWidest; p has even coordinates.
Crossing crossing_of(const Triangle& triangle, const Point& p, int axis);

// Returns the sign of the crossing between p and the point that is `length` lattice units further
// along the axis, or 0 if the triangle does not cross this segment. `length` must be above 0.
int leg_crossing(const Triangle& triangle, const Point& p, int axis, int64_t length);

// Returns the winding number of p: the sum of the signs of the crossings on a ray from p in the
// negative direction of the axis. On a closed mesh, it is the same for every axis.
int winding_number(const Triangles& triangles, const Point& p, int axis);

}  // namespace oracle
