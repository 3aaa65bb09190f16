// Finds the maximal empty cubes of the octree.
#pragma once

#include <span>
#include <vector>

#include "core/geometry/cube.h"

namespace voxdag {

// Returns the maximal cubes that overlap no cube of `occupied`. The parent of each returned cube
// contains a cube of `occupied`. The cubes of `occupied` are disjoint. Returns the grid if
// `occupied` is empty.
std::vector<Cube> maximal_empty_cubes(std::span<const Cube> occupied);

}  // namespace voxdag
