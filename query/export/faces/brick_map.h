// The bricks of a selection in Morton order. Finds the neighbors of each brick. Immutable once all
// bricks and cubes were added.
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

// A cube of at least 8 cells per edge whose cells are all set. Its bricks are not added separately.
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
  // Bricks must be added in Morton order, and so must full cubes.
  void add(const BrickMask& brick) { bricks_.push_back(brick); }
  void add(const FullCube& cube) { cubes_.push_back(cube); }
  const std::vector<BrickMask>& bricks() const { return bricks_; }
  const std::vector<FullCube>& cubes() const { return cubes_; }

  // Returns the Morton code of the next brick along an axis, above if `upward` is true, otherwise
  // below. If the brick is at the border of the grid, the result is a code outside the grid.
  static uint64_t next_morton(uint64_t morton, uint8_t axis, bool upward) {
    const uint64_t bits = uint64_t{0x1249249249249249} << (2 - axis);
    const uint64_t next = upward ? (morton | ~bits) + 1 : (morton & bits) - 1;
    return (next & bits) | (morton & ~bits);
  }

  // Returns the mask of the brick with this Morton code; 0 if the brick has no set cells. The
  // search begins at the index `from` in bricks() and goes in the direction `upward`
  // (find_brick()).
  uint64_t mask_at(uint64_t morton, size_t from, bool upward) const {
    const auto found = find_brick(morton, from, upward);
    if (found != bricks_.end() && found->morton == morton) return found->mask;
    const auto after = std::ranges::upper_bound(cubes_, morton, {}, &FullCube::morton);
    if (after == cubes_.begin()) return 0;
    const FullCube& cube = *std::prev(after);
    return morton - cube.morton < cells_of_cube(cube.edge / kBrickEdge) ? ~uint64_t{0} : 0;
  }

 private:
  // Returns the first brick whose Morton code is at least `morton`. The search begins at the index
  // `from` and goes to larger codes if `upward` is true, otherwise to smaller codes. The next brick
  // along an axis is often close to `from` in Morton order, so the steps begin with 1 and double.
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
