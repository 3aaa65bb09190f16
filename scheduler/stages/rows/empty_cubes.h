// Finds the maximal empty cubes of the octree.
#pragma once

#include <span>
#include <vector>

#include "core/geometry/cube.h"

namespace voxdag {

// Returns the largest cubes that contain no cube of `occupied`: the parent of each contains one.
// The cubes of `occupied` are disjoint. Returns the grid if `occupied` is empty.
std::vector<Cube> maximal_empty_cubes(std::span<const Cube> occupied);

}  // namespace voxdag
