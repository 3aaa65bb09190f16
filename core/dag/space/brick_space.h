// The empty voxels of a brick as bits of a mask, and the 6-connected components of these voxels.
//
// A face is numbered 2 * axis + side; side 1 has the larger coordinates. A set of faces is a mask
// of six bits.
#pragma once

#include <cstdint>

#include "core/dag/brick.h"
#include "core/geometry/overlap.h"

namespace voxdag {

inline constexpr int kFaces = 6;
inline constexpr uint8_t kAllFaces = (1 << kFaces) - 1;

// Returns the set of an octant's faces that are on the surface of the octant's parent.
constexpr uint8_t outer_faces(int octant) {
  uint8_t faces = 0;
  for (int a = 0; a < 3; ++a)
    faces = static_cast<uint8_t>(faces | 1 << (2 * a + (octant >> (2 - a) & 1)));
  return faces;
}

// of[a][c] is the mask of the voxels whose coordinate along axis a is c.
struct BrickLayers {
  uint64_t of[3][kBrickEdge] = {};
  constexpr BrickLayers() {
    for (int a = 0; a < 3; ++a)
      for (int bit = 0; bit < 64; ++bit) of[a][brick_coordinate(bit, a)] |= uint64_t{1} << bit;
  }
};
inline constexpr BrickLayers kBrickLayers;

// Returns the voxels of a brick at a face.
constexpr uint64_t brick_face(int face) {
  return kBrickLayers.of[face / 2][face % 2 != 0 ? kBrickEdge - 1 : 0];
}

// Returns the difference of the bit numbers of opposite voxels at the high and the low face of a
// brick. A mask of voxels at the high face, shifted right by this number, is a mask of the opposite
// voxels at the low face.
constexpr int brick_face_shift(int axis) { return 36 >> axis; }

// Returns the 6-neighbors, in the brick, of the voxels in `mask`.
constexpr uint64_t brick_neighbors(uint64_t mask) {
  uint64_t out = 0;
  for (int a = 0; a < 3; ++a) {
    const uint64_t(&layer)[kBrickEdge] = kBrickLayers.of[a];
    const int near = 4 >> a, far = 28 >> a;  // differences between the bit numbers of neighbors
    out |= (mask & (layer[0] | layer[2])) << near | (mask & layer[1]) << far;
    out |= (mask & (layer[1] | layer[3])) >> near | (mask & layer[2]) >> far;
  }
  return out;
}

// Returns the voxels of `empty` that a path of 6-neighbors within `empty` connects to a voxel of
// `seed`.
constexpr uint64_t brick_flood(uint64_t seed, uint64_t empty) {
  uint64_t reached = seed & empty;
  while (true) {
    const uint64_t grown = reached | (brick_neighbors(reached) & empty);
    if (grown == reached) return reached;
    reached = grown;
  }
}

// Returns the faces of the brick at which `mask` has a voxel.
constexpr uint8_t brick_touch(uint64_t mask) {
  uint8_t faces = 0;
  for (int f = 0; f < kFaces; ++f)
    if ((mask & brick_face(f)) != 0) faces = static_cast<uint8_t>(faces | 1 << f);
  return faces;
}

// Calls visit(mask) for each component of a brick's empty voxels that has a voxel at a face.
template <class Visit>
void for_each_open_component(uint64_t empty, Visit visit) {
  uint64_t boundary = 0;
  for (int f = 0; f < kFaces; ++f) boundary |= brick_face(f);
  for (uint64_t rest = empty & boundary; rest != 0;) {
    const uint64_t component = brick_flood(rest & (~rest + 1), empty);
    visit(component);
    rest &= ~component;
  }
}

}  // namespace voxdag
