// A second implementation of the documented map from world space to the lattice.
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

// Returns the default cube. It contains all vertices, and its edge is slightly larger than the
// scene's longest extent.
WorldCube default_cube(const std::vector<WorldTriangle>& triangles);
// Returns the cube for voxels of a given size, centered on the scene.
WorldCube cube_of_voxel_size(const std::vector<WorldTriangle>& triangles, double voxel_size,
                             int64_t resolution);

// Snaps all triangles to the lattice. Omits triangles whose bounding boxes miss the grid.
Triangles snap(const std::vector<WorldTriangle>& triangles, const WorldCube& cube,
               int64_t resolution);

}  // namespace oracle
