// Generated scenes for the self-test: triangles in lattice units (1/256 voxel) of a grid of
// 2^grid_levels voxels per edge. The code uses only the standard library.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/geometry/cube.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag::selftest {

struct Scene {
  std::string name;
  std::vector<FixedTriangle> triangles;
};

// Returns `count` small scenes in and around `cube`, of every kind that is difficult to voxelize
// exactly: mixed and degenerate triangles, slivers, triangles smaller than a voxel, walls, planes
// of 45 degrees through voxel corners, triangles that span the cube, and vertices at the limit of
// the coordinates.
std::vector<Scene> tricky_scenes(uint64_t seed, const Cube& cube, uint32_t grid_levels, int count);

// Returns a surface like a scanned one: about `triangles` small triangles on a bumpy ball that
// fills the grid.
Scene scan(uint64_t triangles, uint32_t grid_levels);

// Returns a building of large and small triangles: floors, walls, round columns and folded
// curtains.
Scene building(uint64_t triangles, uint32_t grid_levels);

}  // namespace voxdag::selftest
