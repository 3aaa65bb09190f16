// Tests faces_of_brick() and BrickRowOrder against simple loops, and BrickRows against a plain
// sort.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "query/export/faces/brick_faces.h"
#include "query/export/faces/brick_rows.h"

namespace voxdag::query {
namespace {

uint64_t slow_faces(uint64_t mask, uint64_t neighbor, uint8_t axis, bool upward) {
  uint64_t faces = 0;
  for (int bit = 0; bit < 64; ++bit) {
    int at[3] = {brick_coordinate(bit, 0), brick_coordinate(bit, 1), brick_coordinate(bit, 2)};
    at[axis] += upward ? 1 : -1;
    const bool inside = at[axis] >= 0 && at[axis] < kBrickEdge;
    at[axis] &= kBrickEdge - 1;
    const uint64_t other = (inside ? mask : neighbor) >> brick_bit(at[0], at[1], at[2]) & 1;
    if ((mask >> bit & 1) && !other) faces |= uint64_t{1} << bit;
  }
  return faces;
}

TEST(Faces, OfRandomBricks) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 2000; ++i) {
    const uint64_t mask = random() & (i % 2 ? random() : ~uint64_t{0}), neighbor = random();
    for (uint8_t axis = 0; axis < 3; ++axis)
      for (const bool upward : {false, true}) {
        ASSERT_EQ(faces_of_brick(mask, neighbor, axis, upward),
                  slow_faces(mask, neighbor, axis, upward));
        const uint64_t inner = mask & ~side_cells(axis, upward);
        ASSERT_EQ(faces_of_brick(inner, neighbor, axis, upward),
                  faces_of_brick(inner, 0, axis, upward));
      }
  }
}

// A brick in the order of rows has the cell (i, v, u) at bit 16 i + 4 v + u.
TEST(Faces, BricksInTheOrderOfRows) {
  for (int axis = 0; axis < 3; ++axis) {
    const BrickRowOrder order(axis);
    for (int bit = 0; bit < 64; ++bit) {
      const int i = brick_coordinate(bit, axis), u = brick_coordinate(bit, (axis + 1) % 3),
                v = brick_coordinate(bit, (axis + 2) % 3);
      ASSERT_EQ(order(uint64_t{1} << bit), uint64_t{1} << (16 * i + 4 * v + u));
    }
    ASSERT_EQ(order(~uint64_t{0}), ~uint64_t{0});
  }
}

struct TestBrick {
  Position at;  // in bricks
  uint64_t mask;
};

// Checks that `sorted` has the bricks `bricks` in the order of an axis.
void expect_sorted(std::span<const RowBrick> sorted, size_t axis, std::vector<TestBrick> bricks) {
  const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  std::ranges::sort(bricks, [&](const TestBrick& a, const TestBrick& b) {
    return std::array{a.at[axis], a.at[v], a.at[u]} < std::array{b.at[axis], b.at[v], b.at[u]};
  });
  ASSERT_EQ(sorted.size(), bricks.size());
  for (size_t i = 0; i < bricks.size(); ++i) {
    ASSERT_EQ(static_cast<int64_t>(sorted[i].slab()), bricks[i].at[axis]);
    ASSERT_EQ(static_cast<int64_t>(sorted[i].v()), bricks[i].at[v]);
    ASSERT_EQ(static_cast<int64_t>(sorted[i].u()), bricks[i].at[u]);
    ASSERT_EQ(sorted[i].mask, bricks[i].mask);
  }
}

// Sorts few bricks, and enough bricks for the radix sort, in a small grid and in the largest grid.
TEST(Faces, BricksAreSortedByRows) {
  std::mt19937_64 random(2);
  for (const auto& [count, extent] : {std::pair{100, 32}, {5000, 64}, {3000, 1 << 18}}) {
    MemoryBudget budget(uint64_t{1} << 26);
    BrickRows rows(budget, static_cast<uint64_t>(count), 0, "bricks");
    std::set<Position> used;
    std::vector<TestBrick> bricks;
    while (bricks.size() < static_cast<size_t>(count)) {
      Position at{};
      for (int64_t& coordinate : at)
        coordinate = static_cast<int64_t>(random() % static_cast<uint64_t>(extent));
      if (!used.insert(at).second) continue;
      bricks.push_back({at, random()});
      rows.add({4 * at[0], 4 * at[1], 4 * at[2]}, bricks.back().mask);
    }
    for (size_t axis = 0; axis < 3; ++axis)
      expect_sorted(rows.sorted(static_cast<int>(axis)), axis, bricks);
  }
}

// For each axis, a full cube of several bricks is listed only by the bricks at its low and at its
// high side. Each of these bricks has faces only on the outer side.
TEST(Faces, FullCubesHaveTwoSides) {
  MemoryBudget budget(uint64_t{1} << 20);
  BrickRows rows(budget, 1, 16, "bricks");
  rows.add({0, 0, 0}, 5);
  rows.add_full_cube({16, 32, 48}, 16);
  for (size_t axis = 0; axis < 3; ++axis) {
    std::vector<TestBrick> bricks = {{{0, 0, 0}, 5}};
    for (int64_t x = 4; x < 8; ++x)
      for (int64_t y = 8; y < 12; ++y)
        for (int64_t z = 12; z < 16; ++z) {
          const int64_t inside = std::array{x - 4, y - 8, z - 12}[axis];
          if (inside == 0 || inside == 3) bricks.push_back({{x, y, z}, ~uint64_t{0}});
        }
    const std::span<const RowBrick> sorted = rows.sorted(static_cast<int>(axis));
    expect_sorted(sorted, axis, bricks);
    for (const RowBrick& brick : sorted.subspan(1)) {
      const bool is_low = brick.slab() == 4 * (axis + 1);
      EXPECT_EQ(brick.has_faces(false), is_low);
      EXPECT_EQ(brick.has_faces(true), !is_low);
    }
  }
}

}  // namespace
}  // namespace voxdag::query
