// The bricks of a selection, sorted by slabs and rows of one axis: the faces perpendicular to the
// axis are then found in one sequential pass.
//
//   slab   the bricks with the same coordinate along the axis
//   row    the bricks of a slab with the same coordinate v
//
// The axes are cyclic: in a slab of axis a, coordinate u is along the axis after a, and coordinate
// v is along the axis after that; z is followed by x. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/dag/brick.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// A brick. The key has its position in bricks: slab, v and u, with 19 bits each, highest first. The
// two lowest bits of the key are flags: the brick has no faces toward lower coordinates on the axis
// of the slabs, or none toward higher coordinates.
struct RowBrick {
  static constexpr int kCoordinateBits = 19;
  static constexpr int kFlagBits = 2;
  static constexpr uint64_t kNoLowerFaces = 1, kNoUpperFaces = 2;
  static constexpr uint64_t kCoordinateMask = (uint64_t{1} << kCoordinateBits) - 1;

  uint64_t key = 0;
  uint64_t mask = 0;

  static uint64_t key_of(uint64_t slab, uint64_t v, uint64_t u, uint64_t flags = 0) {
    return ((slab << kCoordinateBits | v) << kCoordinateBits | u) << kFlagBits | flags;
  }
  uint64_t u() const { return key >> kFlagBits & kCoordinateMask; }
  uint64_t v() const { return key >> (kFlagBits + kCoordinateBits) & kCoordinateMask; }
  uint64_t slab() const { return key >> (kFlagBits + 2 * kCoordinateBits); }
  uint64_t place_in_slab() const { return key >> kFlagBits & kPlaceMask; }
  bool has_faces(bool upward) const {
    return (key & (upward ? kNoUpperFaces : kNoLowerFaces)) == 0;
  }

 private:
  static constexpr uint64_t kPlaceMask = (uint64_t{1} << 2 * kCoordinateBits) - 1;
};

class BrickRows {
 public:
  // `bricks` is the number of single bricks that will be added. `cube_sides` is the sum, over all
  // full cubes that will be added, of the bricks on one side of the cube. `what` names the memory
  // in error messages. Throws Error{kOutOfMemory}.
  BrickRows(MemoryBudget& budget, uint64_t bricks, uint64_t cube_sides, std::string_view what);

  // `low` is a low corner in cells. A full cube has at least 8 cells per edge, all of them set.
  void add(const Position& low, uint64_t mask);
  void add_full_cube(const Position& low, int64_t edge);

  // Sorts the bricks by the slabs and rows of an axis, and returns them. For a full cube, the list
  // has only the bricks on the two sides of the cube that are perpendicular to the axis. Must be
  // called for the axes 0, 1 and 2 in this order.
  std::span<const RowBrick> sorted(int axis);

 private:
  struct Cube {
    Position low;  // in bricks
    int64_t edge;
  };
  void turn_keys();
  void add_sides(const Cube& cube, int axis);
  void sort();

  PageBuffer<RowBrick> bricks_, scratch_;
  size_t singles_ = 0;  // number of single bricks, with which bricks_ begins
  size_t size_ = 0;
  std::vector<Cube> cubes_;
};

}  // namespace voxdag::query
