// Finds the component of the empty space (space_labels.h) that contains a given voxel of a
// sub-DAG's cube.
#pragma once

#include <array>
#include <cstdint>

#include "core/dag/space/space_labels.h"

namespace voxdag {

// A voxel's position in a cube, in voxels from the cube's low corner.
using CubeVoxel = std::array<uint32_t, 3>;

struct SeedPlace {
  enum class Kind : uint8_t {
    kSet,     // the voxel is set
    kOpen,    // the voxel's component has a voxel at a face of the root's cube
    kClosed,  // its component has no voxel at the faces of some node or brick around the voxel
  };
  Kind kind = Kind::kSet;
  int depth = 0;           // kClosed: the largest depth of such a node or brick
  uint32_t component = 0;  // kOpen: component of the root; kClosed: component of the node's octant
                           // around the voxel
};

// Returns the octant around the voxel in a node at depth `depth`. The node's cube must contain the
// voxel.
inline int octant_around(const CubeVoxel& voxel, int brick_depth, int depth) {
  const int bit = brick_depth + kBrickLevels - 1 - depth;
  return static_cast<int>((voxel[0] >> bit & 1) << 2 | (voxel[1] >> bit & 1) << 1 |
                          (voxel[2] >> bit & 1));
}
// Returns the bit of the voxel in the mask of its brick.
inline int bit_in_brick(const CubeVoxel& voxel) {
  return brick_bit(static_cast<int>(voxel[0] % kBrickEdge), static_cast<int>(voxel[1] % kBrickEdge),
                   static_cast<int>(voxel[2] % kBrickEdge));
}

SeedPlace find_seed(const SpaceLabels& labels, const CubeVoxel& voxel);

}  // namespace voxdag
