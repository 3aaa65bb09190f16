// Writes triangles as the plainest .glb file: one mesh, positions as floats, no indices.
#pragma once

#include <string>
#include <vector>

#include "tests/oracle/grid.h"

namespace reference {

using oracle::Triangles;
using oracle::WorldTriangle;

// Lattice units become world units of a voxel each; exact up to 2^24 units.
std::vector<WorldTriangle> as_world(const Triangles& triangles);
// What floats make of the coordinates.
std::vector<WorldTriangle> as_floats(std::vector<WorldTriangle> triangles);

// `copies` of all triangles, one after the other.
void write_glb(const std::string& path, const std::vector<WorldTriangle>& triangles,
               int copies = 1);

}  // namespace reference
