// The voxels that each rule sets, by brute force: `thin` tests every row through a voxel's center,
// and the solid rules test every sample row of the grid. For grids of 4 to 32 voxels per edge.
#pragma once

#include "tests/oracle/triangle.h"
#include "tests/oracle/voxels.h"

namespace oracle {

// Sets a voxel iff a triangle crosses, within the voxel, one of the three rows through its center.
Voxels voxelize_thin(const Triangles& triangles, const Region& region);

enum class SolidRule { kWinding, kParity, kEnclosed };

struct Solid {
  Voxels voxels;          // the shell and the interior
  uint64_t interior = 0;  // voxels that are not in the shell
  // rows: sample rows (docs/solid.md) with a crossing. open_rows: rows on which the signs of
  // the crossings do not sum to 0. odd_rows: rows with an odd number of crossings. disputed: voxels
  // of filled units whose sum of views is not a multiple of 6 * points (Unit in rules.cc). All four
  // are 0 for kEnclosed.
  uint64_t rows = 0, open_rows = 0, odd_rows = 0, disputed = 0;
};

// Fills the grid of `edge` voxels per edge, a power of two. All triangles count, also those outside
// the grid.
Solid voxelize_solid(const Triangles& triangles, int edge, SolidRule rule);

}  // namespace oracle
