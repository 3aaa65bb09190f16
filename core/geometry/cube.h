// Octree-aligned cubes of the grid and the order of their children.
//
//        level 0 = the whole grid, edge R = 2^L voxels
//        level l: edge 2^(L-l) voxels; bricks (edge 4) are level L-2
//
// Child index = 4x + 2y + z of the child's position in its parent (Morton order).
#pragma once

#include <compare>
#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag {

inline constexpr int kMinGridLevels = 2;   // R = 4: the root is a brick
inline constexpr int kMaxGridLevels = 20;  // R = 1 048 576

// Returns a child's coordinate in its parent along an axis, 0 or 1.
VOXDAG_HD constexpr int child_coordinate(int index, int axis) { return index >> (2 - axis) & 1; }

struct Cube {
  uint32_t level = 0;                // 0 is the whole grid
  uint32_t position[3] = {0, 0, 0};  // in cubes of this level, axis x, y, z

  VOXDAG_HD Cube child(int index) const {
    return {level + 1,
            {2 * position[0] + ((index >> 2) & 1), 2 * position[1] + ((index >> 1) & 1),
             2 * position[2] + (index & 1)}};
  }
  VOXDAG_HD Cube parent() const {
    return {level - 1, {position[0] >> 1, position[1] >> 1, position[2] >> 1}};
  }
  // Returns the child index of this cube in its parent.
  VOXDAG_HD int child_index() const {
    return static_cast<int>(4 * (position[0] & 1) + 2 * (position[1] & 1) + (position[2] & 1));
  }
  // Returns the edge in voxels, on a grid of 2^grid_levels voxels per edge.
  VOXDAG_HD int64_t edge_voxels(uint32_t grid_levels) const {
    return int64_t{1} << (grid_levels - level);
  }
  // Orders by level, then x, y and z. For containers only: this order has no meaning in the octree.
  std::strong_ordering operator<=>(const Cube&) const = default;
};

}  // namespace voxdag
