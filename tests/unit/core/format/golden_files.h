// The contents of the files in tests/golden.
#pragma once

#include "tests/unit/core/format/test_artifacts.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {

// Returns the example of docs/format.md: in a grid of 8^3 voxels, the floor y = 0 and a pillar of 8
// voxels at a corner.
inline oracle::Dag floor_and_pillar() {
  oracle::Voxels voxels(8);
  for (int x = 0; x < 8; ++x)
    for (int z = 0; z < 8; ++z) voxels.set(x, 0, z);
  for (int y = 0; y < 8; ++y) voxels.set(0, y, 0);
  return oracle::build_dag(voxels, 64);
}

inline Grid floor_and_pillar_grid() { return Grid::given({-1, 0, -1}, 2, 3); }

}  // namespace voxdag
