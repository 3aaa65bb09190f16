// The maximal empty cubes of the octree above a set of cubes.
#pragma once

#include <span>
#include <vector>

#include "core/geometry/cube.h"

namespace voxdag {

// Returns the largest cubes that contain none of `occupied`, which are disjoint, but whose parents
// do. Returns the grid if `occupied` is empty.
std::vector<Cube> maximal_empty_cubes(std::span<const Cube> occupied);

}  // namespace voxdag
