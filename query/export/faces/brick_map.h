// The bricks of a selection in Morton order, in which the neighbors of a brick can be found.
// Immutable after all bricks and cubes were added.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/dag/brick.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {

struct BrickMask {
  uint64_t morton = 0;  // Morton code of the brick's low corner, in bricks
  uint64_t mask = 0;
};

// A cube of at least 8 cells per edge in which all cells are set.
struct FullCube {
  uint64_t morton = 0;  // Morton code of the low corner, in bricks
  int64_t edge = 0;     // in cells
};

class BrickMap {
 public:
  static uint64_t bytes(uint64_t bricks, uint64_t cubes) {
    return bricks * sizeof(BrickMask) + cubes * sizeof(FullCube);
  }
  void reserve(uint64_t bricks, uint64_t cubes) {
    bricks_.reserve(bricks);
    cubes_.reserve(cubes);
  }
  // Call the following two functions in Morton order.
  void add(const BrickMask& brick) { bricks_.push_back(brick); }
  void add(const FullCube& cube) { cubes_.push_back(cube); }
  const std::vector<BrickMask>& bricks() const { return bricks_; }
  const std::vector<FullCube>& cubes() const { return cubes_; }

  // Returns the Morton code of the next brick along an axis. The result for a brick at the end of
  // the grid is no brick's code.
  static uint64_t next_morton(uint64_t morton, uint8_t axis, bool upward) {
    const uint64_t bits = uint64_t{0x1249249249249249} << (2 - axis);
    const uint64_t next = upward ? (morton | ~bits) + 1 : (morton & bits) - 1;
    return (next & bits) | (morton & ~bits);
  }

  // Returns the mask of the brick with this Morton code; 0 if no cell of the brick is set. `from`
  // and `upward` as in find_brick().
  uint64_t mask_at(uint64_t morton, size_t from, bool upward) const {
    const auto found = find_brick(morton, from, upward);
    if (found != bricks_.end() && found->morton == morton) return found->mask;
    const auto after = std::ranges::upper_bound(cubes_, morton, {}, &FullCube::morton);
    if (after == cubes_.begin()) return 0;
    const FullCube& cube = *std::prev(after);
    return morton - cube.morton < cells_of_cube(cube.edge / kBrickEdge) ? ~uint64_t{0} : 0;
  }

 private:
  // Returns the first brick with this Morton code or a larger one. Searches from `from` toward
  // larger codes if `upward` is true, otherwise toward smaller codes. Neighbors in Morton order are
  // often near, so the step begins with 1 and doubles.
  std::vector<BrickMask>::const_iterator find_brick(uint64_t morton, size_t from,
                                                    bool upward) const {
    size_t low = from, high = from, step = 1;
    if (upward)
      for (; (high = std::min(low + step, bricks_.size())) < bricks_.size() &&
             bricks_[high].morton < morton;
           step *= 2)
        low = high;
    else
      for (; (low = high - std::min(step, high)) > 0 && bricks_[low].morton >= morton; step *= 2)
        high = low;
    const auto at = bricks_.begin();
    return std::ranges::lower_bound(at + static_cast<ptrdiff_t>(low),
                                    at + static_cast<ptrdiff_t>(high), morton, {},
                                    &BrickMask::morton);
  }

  std::vector<BrickMask> bricks_;
  std::vector<FullCube> cubes_;
};

}  // namespace voxdag::query
