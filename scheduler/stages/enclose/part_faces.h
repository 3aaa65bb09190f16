// The parts of the grid that have voxels of the shell (voxels that triangles touch), and the
// components of the empty space at their faces (core/dag/space).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/dag/space/brick_space.h"
#include "core/format/artifact/artifact.h"
#include "core/geometry/cube.h"
#include "scheduler/solid/row_file.h"

namespace voxdag {

struct LabeledPart {
  Cube cube;
  ArtifactRef shell;           // the artifact that has the part's shell
  std::vector<uint8_t> touch;  // by component: the faces at which it has a voxel
  // The component with the build's seed, if the seed is in this part and its component reaches a
  // face.
  std::optional<uint32_t> seed_component;
  RowExtent faces[kFaces];  // quadtrees of the part's faces (core/dag/space/face_code.h)
};

}  // namespace voxdag
