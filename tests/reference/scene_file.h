// Writes triangles as a minimal .glb file: one mesh, positions as floats, no indices.
#pragma once

#include <string>
#include <vector>

#include "tests/oracle/grid.h"

namespace reference {

using oracle::Triangles;
using oracle::WorldTriangle;

// Converts triangles from lattice units to a world space where a voxel has the edge 1. The result
// is exact for coordinates up to 2^24 lattice units.
std::vector<WorldTriangle> as_world(const Triangles& triangles);
// Returns the triangles with their coordinates rounded to floats.
std::vector<WorldTriangle> as_floats(std::vector<WorldTriangle> triangles);

// Writes a file with all triangles, `copies` times one after the other.
void write_glb(const std::string& path, const std::vector<WorldTriangle>& triangles,
               int copies = 1);

}  // namespace reference
