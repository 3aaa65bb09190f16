// Faces of the cells of a brick, as masks of the cells that have them.
#pragma once

#include <cstdint>

#include "core/dag/brick.h"
#include "core/dag/space/brick_space.h"

namespace voxdag::query {

// Returns the mask of the cells next to a side of the brick: its upper side along `axis` if
// `upward` is true, otherwise its lower side.
constexpr uint64_t side_cells(uint8_t axis, bool upward) { return brick_face(2 * axis + upward); }

// Returns the mask of the brick's cells that have a face on the surface: a face perpendicular to
// `axis`, on the cell's upper side if `upward` is true, otherwise on its lower side. `neighbor` is
// the mask of the next brick on that side; it only matters if the brick has side_cells().
inline uint64_t faces_of_brick(uint64_t mask, uint64_t neighbor, uint8_t axis, bool upward) {
  const uint64_t(&layer)[kBrickEdge] = kBrickLayers.of[axis];
  const int near = 4 >> axis, far = 28 >> axis;  // differences between the bit numbers of neighbors
  const int shift = brick_face_shift(axis);
  // Bit i of `next` is set if the cell on the other side of cell i's face is set.
  uint64_t next;
  if (upward)
    next = (mask >> near & (layer[0] | layer[2])) | (mask >> far & layer[1]) |
           (neighbor << shift & layer[3]);
  else
    next = (mask << near & (layer[1] | layer[3])) | (mask << far & layer[2]) |
           (neighbor >> shift & layer[0]);
  return mask & ~next;
}

}  // namespace voxdag::query
