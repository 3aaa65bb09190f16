// Scenes for the self-test, made from a seed with nothing but the standard library: triangles on
// the lattice of a grid of 2^grid_levels voxels.
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

// Small scenes of every kind that exact voxelization has to get right, in and around `cube`: mixed,
// degenerate, slivers, smaller than a voxel, walls, 45 degrees through voxel corners, spanning the
// cube, vertices at the limit of the coordinates.
std::vector<Scene> tricky_scenes(uint64_t seed, const Cube& cube, uint32_t grid_levels, int count);

// A surface as scanners give them: small triangles all over a bumpy ball that fills the grid. About
// `triangles` of them.
Scene scan(uint64_t triangles, uint32_t grid_levels);

// A building: floors, walls, round columns and folded curtains; large triangles beside small ones.
Scene building(uint64_t triangles, uint32_t grid_levels);

}  // namespace voxdag::selftest
