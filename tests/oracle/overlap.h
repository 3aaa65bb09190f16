// Decides whether a closed triangle touches a closed cube, by the separating-axis theorem: two
// convex bodies do not touch if and only if their projections onto one of a few axes do not touch.
#pragma once

#include "tests/oracle/triangle.h"

namespace oracle {

// `low`: the cube's low corner. `low` and `edge` are in lattice units (1/256 voxel). Coordinates
// are at most kWidest + 1.
bool touches(const Triangle& triangle, const Point& low, int64_t edge);

}  // namespace oracle
