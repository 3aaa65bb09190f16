// Does a closed triangle touch a closed cube? By the plain separating-axis theorem: two convex
// bodies are apart iff their projections onto one of a few axes are apart.
#pragma once

#include "tests/oracle/triangle.h"

namespace oracle {

// `low` and `edge` in lattice units; coordinates up to kWidest + 1.
bool touches(const Triangle& triangle, const Point& low, int64_t edge);

}  // namespace oracle
