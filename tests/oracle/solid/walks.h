// Computes enclosed solids with a radius by brute force: moves a cube through the grid, voxel by
// voxel.
#pragma once

#include "tests/oracle/voxels.h"

namespace oracle {

// Returns the shell and all voxels that no walk of an empty cube of radius + 1 voxels per edge
// covers. The walks begin outside the grid, where all voxels are empty.
Voxels enclose(const Voxels& shell, int radius);

}  // namespace oracle
