// World space to the lattice, as the design page has it, written a second time.
#pragma once

#include <array>
#include <vector>

#include "tests/oracle/triangle.h"

namespace oracle {

using WorldPoint = std::array<double, 3>;
using WorldTriangle = std::array<WorldPoint, 3>;

// The cube that the grid fills.
struct WorldCube {
  WorldPoint origin{0, 0, 0};
  double edge = 1;
};

// The default cube: around all vertices, a little larger than the longest side.
WorldCube default_cube(const std::vector<WorldTriangle>& triangles);
// Voxels of one size, centered on the scene.
WorldCube cube_of_voxel_size(const std::vector<WorldTriangle>& triangles, double voxel_size,
                             int64_t resolution);

// Snaps all triangles; those whose boxes miss the grid are left out.
Triangles snap(const std::vector<WorldTriangle>& triangles, const WorldCube& cube,
               int64_t resolution);

}  // namespace oracle
