// Computes enclosed solids with a radius by brute force: moves a cube through the grid, voxel by
// voxel.
#pragma once

#include <array>
#include <optional>

#include "tests/oracle/voxels.h"

namespace oracle {

// Returns the shell and all voxels that no walk of an empty cube of radius + 1 voxels per edge
// covers. The walks begin outside the grid, where all voxels are empty.
Voxels enclose(const Voxels& shell, int radius);

struct SeededSolid {
  Voxels voxels;
  bool is_enclosed = false;  // the walk does not leave the grid
};
// Computes the solid that a walk of an empty cube of radius + 1 voxels per edge finds. At the start
// of the walk, the voxel `seed` has the coordinates radius / 2 (rounded down) relative to the
// cube's low corner. The solid consists of all voxels that no empty cube outside the walk contains.
// If the walk leaves the grid, the result is computed as if the walk had no cubes. Returns nullopt
// if the cube is not empty at the start.
std::optional<SeededSolid> enclose_seed(const Voxels& shell, int radius,
                                        const std::array<int, 3>& seed);

}  // namespace oracle
