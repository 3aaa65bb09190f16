// Writes triangles as a minimal .glb file: one mesh, positions as floats, no indices.
#pragma once

#include <string>
#include <vector>

#include "tests/oracle/grid.h"

namespace reference {

using oracle::Triangles;
using oracle::WorldTriangle;

// Returns the triangles in a world space where a voxel has edge 1. Exact for coordinates up to 2^24
// lattice units.
std::vector<WorldTriangle> as_world(const Triangles& triangles);
// Returns the triangles with their coordinates rounded to floats.
std::vector<WorldTriangle> as_floats(std::vector<WorldTriangle> triangles);

// Writes all triangles `copies` times, one copy after the other.
void write_glb(const std::string& path, const std::vector<WorldTriangle>& triangles,
               int copies = 1);

}  // namespace reference
