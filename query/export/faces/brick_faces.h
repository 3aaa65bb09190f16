// Faces of the cells of a brick, as masks of the cells that have them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/dag/brick.h"

namespace voxdag::query {

// Returns the mask of a brick's cells with this coordinate along an axis.
constexpr uint64_t brick_layer(int axis, int coordinate) {
  uint64_t layer = 0;
  for (int bit = 0; bit < 64; ++bit)
    if (brick_coordinate(bit, axis) == coordinate) layer |= uint64_t{1} << bit;
  return layer;
}
// kBrickLayers[axis][coordinate] is brick_layer(axis, coordinate).
inline constexpr auto kBrickLayers = [] {
  std::array<std::array<uint64_t, kBrickEdge>, 3> layers{};
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 0; i < kBrickEdge; ++i)
      layers[static_cast<size_t>(axis)][static_cast<size_t>(i)] = brick_layer(axis, i);
  return layers;
}();

// Returns the mask of the cells next to a side of the brick: its upper side along `axis` if
// `upward` is true, otherwise its lower side.
inline uint64_t side_cells(uint8_t axis, bool upward) { return kBrickLayers[axis][upward ? 3 : 0]; }

// Returns the mask of the brick's cells that have a face on the surface: a face perpendicular to
// `axis`, on the cell's upper side if `upward` is true, otherwise on its lower side. `neighbor` is
// the mask of the next brick on that side; it only matters if the brick has side_cells().
inline uint64_t faces_of_brick(uint64_t mask, uint64_t neighbor, uint8_t axis, bool upward) {
  // The bits of a coordinate in brick_bit() have these weights: from coordinate 0 to 1, and from 2
  // to 3, a bit moves by `low`; from 1 to 2 by high - low; from 3 to 0 by -(high + low).
  const int low = 1 << (2 - axis), high = 1 << (5 - axis);
  const auto& layer = kBrickLayers[axis];
  // Bit i of `next` is set if the cell on the other side of cell i's face is set.
  const uint64_t next =
      upward ? (mask >> low & (layer[0] | layer[2])) | (mask >> (high - low) & layer[1]) |
                   (neighbor << (high + low) & layer[3])
             : (mask << low & (layer[1] | layer[3])) | (mask << (high - low) & layer[2]) |
                   (neighbor >> (high + low) & layer[0]);
  return mask & ~next;
}

}  // namespace voxdag::query
