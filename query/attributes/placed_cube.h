// A cube with set voxels, on one level of a global file.
#pragma once

#include <cstdint>

namespace voxdag::query {

struct PlacedCube {
  uint64_t code = 0;     // Morton code of the cube's position in its level
  uint64_t content = 0;  // see DagView
};

}  // namespace voxdag::query
