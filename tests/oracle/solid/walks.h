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
// Returns the voxels of a solid whose cube starts with its voxel radius / 2 (rounded down, along
// each axis) at `seed`. A voxel is set if every cube that contains it is not empty, or is reached
// by this walk. If the walk leaves the grid, no cube counts as reached. Returns nullopt if the cube
// is not empty at the start.
std::optional<SeededSolid> enclose_seed(const Voxels& shell, int radius,
                                        const std::array<int, 3>& seed);

}  // namespace oracle
