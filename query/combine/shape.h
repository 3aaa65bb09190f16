// A sphere or a box as the second operand of a difference. A shape has no nodes. Instead, it
// computes whether a cube is empty, full or mixed. The rule is exact: a voxel belongs to the shape
// if and only if the voxel's center is in the shape. All lengths are in voxels of the grid.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "query/combine/operation.h"

namespace voxdag::query {

class Shape {
 public:
  // Parses "sphere:X,Y,Z,R" (multiples of 1/2) or "box:X0,Y0,Z0,X1,Y1,Z1" (whole numbers). Throws
  // Error{kInvalidInput} for any other text.
  explicit Shape(const std::string& text);

  // The number of a full cube of any level. It is used where a node of a DAG would have its word
  // offset.
  static constexpr uint64_t kFull = kNoNode - 1;

  // These functions present the shape like the nodes of a DAG with 2^levels voxels per edge. root()
  // and children() return a number for each cube: kNoNode if the cube is empty, kFull if it is
  // full, and any other number if it is mixed. The argument `cube` is the number of a mixed cube;
  // `level` is its level. brick() returns the mask of a brick.
  uint64_t root(uint32_t levels) const { return cube({0, 0, 0}, int64_t{1} << levels); }
  std::array<uint64_t, 8> children(uint32_t levels, uint32_t level, uint64_t cube) const;
  uint64_t brick(uint64_t cube) const;

 private:
  using Position = std::array<int64_t, 3>;

  uint64_t cube(const Position& index, int64_t edge) const;
  // Return kNoNode if none of the voxels from `low` to `high` is in the shape, kFull if all of them
  // are, and otherwise another value.
  uint64_t sphere_cover(const Position& low, const Position& high) const;
  uint64_t box_cover(const Position& low, const Position& high) const;

  bool is_box_ = false;
  // A box has the voxels from low_ to high_, both included. The center and the radius of a sphere
  // are in half voxels, so that the centers of voxels are integers.
  Position low_ = {}, high_ = {};
  Position center_ = {};
  int64_t radius_ = 0;
};

}  // namespace voxdag::query
