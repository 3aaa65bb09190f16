#include "core/dag/brick.h"

#include <gtest/gtest.h>

#include "core/geometry/morton.h"

namespace voxdag {
namespace {

// A voxel's bit is its Morton code within the brick.
TEST(Brick, BitsAreMortonCodes) {
  for (int x = 0; x < kBrickEdge; ++x)
    for (int y = 0; y < kBrickEdge; ++y)
      for (int z = 0; z < kBrickEdge; ++z)
        EXPECT_EQ(static_cast<uint64_t>(brick_bit(x, y, z)),
                  morton_encode(static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                                static_cast<uint32_t>(z)));
  EXPECT_EQ(brick_bit(3, 0, 0), 36);
  EXPECT_EQ(brick_bit(0, 3, 0), 18);
  EXPECT_EQ(brick_bit(0, 0, 3), 9);
  EXPECT_EQ(kBrickEdge, 1 << kBrickLevels);
}

// brick_coordinate() is the inverse of brick_bit().
TEST(Brick, BitsHaveCoordinates) {
  for (int bit = 0; bit < 64; ++bit)
    EXPECT_EQ(
        brick_bit(brick_coordinate(bit, 0), brick_coordinate(bit, 1), brick_coordinate(bit, 2)),
        bit);
}

}  // namespace
}  // namespace voxdag
