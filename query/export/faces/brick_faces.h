// Finds the faces between set and empty cells of a brick. Results are masks with one bit per cell.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/dag/brick.h"
#include "core/dag/space/brick_space.h"

namespace voxdag::query {

// Returns the mask of the 16 cells at one side of a brick: the side with the highest coordinate
// along `axis` if `upward` is true, otherwise the side with the lowest.
constexpr uint64_t side_cells(uint8_t axis, bool upward) { return brick_face(2 * axis + upward); }

// Returns the mask of the set cells whose next cell along `axis` is empty, so that the face between
// the two is on the surface. The next cell is above if `upward` is true, otherwise below. `mask`
// has the set cells of the brick. `neighbor` is the mask of the next brick in this direction; it
// has no effect if no cell of side_cells() is set in `mask`.
inline uint64_t faces_of_brick(uint64_t mask, uint64_t neighbor, uint8_t axis, bool upward) {
  const uint64_t(&layer)[kBrickEdge] = kBrickLayers.of[axis];
  const int near = 4 >> axis, far = 28 >> axis;  // bit distances: in an octant, between octants
  const int shift = brick_face_shift(axis);
  // Bit i of `next` is 1 if the next cell of cell i is set.
  uint64_t next;
  if (upward)
    next = (mask >> near & (layer[0] | layer[2])) | (mask >> far & layer[1]) |
           (neighbor << shift & layer[3]);
  else
    next = (mask << near & (layer[1] | layer[3])) | (mask << far & layer[2]) |
           (neighbor >> shift & layer[0]);
  return mask & ~next;
}

// Reorders the cells of a brick from Morton order to rows along the axis after `axis`. In the
// result, the bit of a cell is 16 i + 4 v + u: i is its coordinate along `axis`, u along the axis
// after that, and v along the last axis; z is followed by x.
class BrickRowOrder {
 public:
  explicit BrickRowOrder(int axis) {
    for (int bit = 0; bit < 64; ++bit) {
      const int to = 16 * brick_coordinate(bit, axis) + 4 * brick_coordinate(bit, (axis + 2) % 3) +
                     brick_coordinate(bit, (axis + 1) % 3);
      for (size_t byte = 0; byte < 256; ++byte)
        if (byte >> bit % 8 & 1) of_[static_cast<size_t>(bit / 8)][byte] |= uint64_t{1} << to;
    }
  }
  uint64_t operator()(uint64_t mask) const {
    uint64_t rows = 0;
    for (size_t i = 0; i < 8; ++i) rows |= of_[i][mask >> 8 * i & 255];
    return rows;
  }

 private:
  std::array<std::array<uint64_t, 256>, 8> of_{};
};

}  // namespace voxdag::query
