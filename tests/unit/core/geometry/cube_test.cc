#include "core/geometry/cube.h"

#include <gtest/gtest.h>

#include <set>
#include <tuple>

#include "core/geometry/morton.h"

namespace voxdag {
namespace {

// The eight children fill the cube. Each has its child index and coordinates, and its parent is the
// cube.
TEST(Cube, ChildrenFillTheirParent) {
  const Cube cube{3, {5, 0, 7}};
  std::set<std::tuple<uint32_t, uint32_t, uint32_t>> seen;
  for (int c = 0; c < 8; ++c) {
    const Cube child = cube.child(c);
    EXPECT_EQ(child.level, 4u);
    EXPECT_EQ(child.child_index(), c);
    EXPECT_EQ(child.parent(), cube);
    for (int a = 0; a < 3; ++a)
      EXPECT_EQ(child.position[a],
                2 * cube.position[a] + static_cast<uint32_t>(child_coordinate(c, a)));
    seen.insert({child.position[0], child.position[1], child.position[2]});
  }
  EXPECT_EQ(seen.size(), 8u);
  EXPECT_EQ(*seen.begin(), std::make_tuple(10u, 0u, 14u));
  EXPECT_EQ(*seen.rbegin(), std::make_tuple(11u, 1u, 15u));
}

// Child index = 4x + 2y + z, so the order of the children is the order of their Morton codes.
TEST(Cube, ChildOrderIsMortonOrder) {
  EXPECT_EQ(Cube{}.child(4), (Cube{1, {1, 0, 0}}));
  EXPECT_EQ(Cube{}.child(2), (Cube{1, {0, 1, 0}}));
  EXPECT_EQ(Cube{}.child(1), (Cube{1, {0, 0, 1}}));
  const Cube cube{20, {1048575, 12345, 777}};
  const auto code = [](const Cube& k) {
    return morton_encode(k.position[0], k.position[1], k.position[2]);
  };
  for (int c = 0; c < 8; ++c)
    EXPECT_EQ(code(cube.child(c)), 8 * code(cube) + static_cast<uint64_t>(c));
}

// The edge of a cube halves with each level, from the grid's edge at level 0 to one voxel at the
// last level.
TEST(Cube, EdgesHalve) {
  EXPECT_EQ(Cube{}.edge_voxels(20), 1048576);
  EXPECT_EQ((Cube{18, {}}).edge_voxels(20), 4);
  EXPECT_EQ((Cube{2, {}}).edge_voxels(2), 1);
}

}  // namespace
}  // namespace voxdag
