// Computes enclosed solids with a radius by brute force: moves a cube through the grid, voxel by
// voxel.
#pragma once

#include <array>
#include <optional>

#include "tests/oracle/voxels.h"

namespace oracle {

// An empty cube of radius + 1 voxels per edge walks in steps of one voxel along an axis. It begins
// outside the grid, where all voxels are empty. Returns the shell and all voxels that the cube
// cannot cover in this way.
Voxels enclose(const Voxels& shell, int radius);

struct SeededSolid {
  Voxels voxels;
  bool is_enclosed = false;  // true if the cube cannot walk out of the grid
};
// An empty cube of radius + 1 voxels per edge walks from the voxel `seed`. At its first position,
// this voxel has the coordinates radius / 2 (rounded down) relative to the cube's low corner.
// Returns nullopt if the cube is not empty there. The solid consists of the voxels that no empty
// cube covers, except at positions that the walk reaches. If the walk leaves the grid, the solid is
// computed as if the walk reached no position.
std::optional<SeededSolid> enclose_seed(const Voxels& shell, int radius,
                                        const std::array<int, 3>& seed);

}  // namespace oracle
