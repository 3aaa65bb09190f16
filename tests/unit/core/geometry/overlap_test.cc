#include "core/geometry/overlap.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/oracle/overlap.h"
#include "tests/oracle/scenes.h"

namespace voxdag {
namespace {

using oracle::Point;
using oracle::Random;
using oracle::Triangle;

struct Box {
  Point low;
  int64_t edge;
};

bool ours(const Triangle& t, const Box& box) {
  FixedTriangle fixed;
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) fixed.v[i][a] = t[i][a];
  const int64_t low[3] = {box.low[0], box.low[1], box.low[2]};
  return triangle_touches_cube(fixed, low, box.edge);
}
bool truth(const Triangle& t, const Box& box) { return oracle::touches(t, box.low, box.edge); }
// True if the triangle touches only the surface of the cube. A test with half-open cubes would miss
// such triangles.
bool grazes(const Triangle& t, const Box& box) {
  return truth(t, box) &&
         !oracle::touches(t, {box.low[0] + 1, box.low[1] + 1, box.low[2] + 1}, box.edge - 2);
}

// Returns a cube of the lattice near some point of the triangle, so that hits and narrow misses are
// about equally frequent.
Box box_near(const Triangle& t, Random& random) {
  Box box;
  box.edge = 256 << random.between(0, random.coin() ? 2 : 8);
  const int64_t a = random.between(0, 1024), b = random.between(0, 1024 - a), c = 1024 - a - b;
  for (int k = 0; k < 3; ++k) {
    // The sum fits in 64 bits: coordinates are below 2^40, weights at most 2^10.
    const int64_t at = (a * t[0][k] + b * t[1][k] + c * t[2][k]) / 1024;
    const int64_t cell = (at & ~(box.edge - 1)) + box.edge * random.between(-1, 1);
    box.low[k] = std::clamp(cell, -(int64_t{1} << 40), (int64_t{1} << 40) - box.edge);
  }
  return box;
}

// voxdag's test and the oracle's test share no formula. They agree on all pairs, which include many
// hits, misses, and contacts without overlap.
TEST(Overlap, EqualsTheOracle) {
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    Random random(100 + static_cast<uint64_t>(kind));
    int hits = 0, misses = 0, contacts = 0;
    for (int i = 0; i < 20000; ++i) {
      const oracle::Region region{{random.between(0, 1 << 10) * 64, random.between(0, 512) * 64, 0},
                                  4 << random.between(0, 6)};
      const uint64_t seed = static_cast<uint64_t>(i);
      const Triangle t = oracle::make_scene(kind, seed, region, 1).front();
      const Box box = box_near(t, random);
      const bool expected = truth(t, box);
      ASSERT_EQ(ours(t, box), expected) << oracle::kind_name(kind) << ", pair " << i;
      (expected ? hits : misses)++;
      contacts += expected && grazes(t, box);
    }
    SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ": " << hits << " hits, "
                                    << misses << " misses, " << contacts << " contacts");
    EXPECT_GT(hits, 1000);
    EXPECT_GT(misses, 1000);
    const bool made_to_touch =
        kind == oracle::SceneKind::kDiagonal || kind == oracle::SceneKind::kThroughCorners;
    EXPECT_GT(contacts, made_to_touch ? 50 : -1);
  }
}

// Triangles and cubes are at random positions up to the limit of the coordinates. No integer
// overflows.
TEST(Overlap, EqualsTheOracleAtTheLimit) {
  Random random(5);
  int hits = 0, misses = 0;
  for (int i = 0; i < 60000; ++i) {
    Triangle t;
    for (Point& p : t)
      for (int64_t& u : p) {
        u = random.odd(-oracle::kWidest, oracle::kWidest);
        if (random.between(0, 3) == 0) u = random.coin() ? oracle::kWidest : -oracle::kWidest;
      }
    Box box = box_near(t, random);
    if (i % 4 == 0) {
      box.edge = int64_t{1} << random.between(20, 40);
      for (int64_t& u : box.low)
        u = std::clamp(u, -(int64_t{1} << 40), (int64_t{1} << 40) - box.edge);
    }
    const bool expected = truth(t, box);
    ASSERT_EQ(ours(t, box), expected) << "pair " << i;
    (expected ? hits : misses)++;
  }
  EXPECT_GT(hits, 10000);
  EXPECT_GT(misses, 10000);
}

// Triangles are near the largest size for which the test uses 64-bit integers. If the 64-bit test
// were used for larger triangles, its sums would overflow.
TEST(Overlap, EqualsTheOracleAtTheNarrowReach) {
  Random random(7);
  int narrow = 0, hits = 0;
  for (int i = 0; i < 60000; ++i) {
    const int64_t reach = kNarrowReach + (random.coin() ? -1 : random.between(0, 2));
    Triangle t;
    for (Point& p : t)
      for (int64_t& u : p)
        u = random.coin() ? random.odd(-reach, reach) : random.coin() ? reach : -reach;
    Box box{{0, 0, 0}, kNarrowReach - random.between(0, 1)};
    if (i % 2 == 0) box.edge = int64_t{1} << random.between(8, 18);
    const bool expected = truth(t, box);
    ASSERT_EQ(ours(t, box), expected) << "pair " << i;
    hits += expected;
    narrow += reach < kNarrowReach && box.edge < kNarrowReach;
  }
  EXPECT_GT(narrow, 10000);
  EXPECT_GT(hits, 5000);
  EXPECT_LT(hits, 55000);
}

// Small triangles around a small cube miss or touch it by single units, at corners, edges and
// faces.
TEST(Overlap, EqualsTheOracleUnitByUnit) {
  Random random(6);
  int contacts = 0;
  for (int i = 0; i < 60000; ++i) {
    // Vertices need not be odd for the test to be right.
    Triangle t;
    for (Point& p : t)
      for (int64_t& u : p) u = random.between(-4, 8);
    const Box box{{0, 0, 0}, 4};
    ASSERT_EQ(ours(t, box), truth(t, box)) << "pair " << i;
    contacts += grazes(t, box);
  }
  EXPECT_GT(contacts, 1000);
}

// A closed cube is the union of its eight closed children. So a triangle touches a cube if and only
// if it touches one of the children.
TEST(Overlap, CubeIsTheUnionOfItsChildren) {
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    Random random(200 + static_cast<uint64_t>(kind));
    for (int i = 0; i < 1500; ++i) {
      const oracle::Region region{{0, 0, 0}, 64};
      const Triangle t = oracle::make_scene(kind, static_cast<uint64_t>(i), region, 1).front();
      const Box box = box_near(t, random);
      const int64_t half = box.edge / 2;
      bool any = false;
      for (int c = 0; c < 8; ++c)
        any |= ours(t, {{box.low[0] + (c & 4 ? half : 0), box.low[1] + (c & 2 ? half : 0),
                         box.low[2] + (c & 1 ? half : 0)},
                        half});
      ASSERT_EQ(any, ours(t, box)) << oracle::kind_name(kind) << ", pair " << i;
    }
  }
}

// If a pair of a triangle and a cube is rotated or mirrored, or the vertices change places, the
// result is the same.
TEST(Overlap, IsSymmetric) {
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    Random random(300 + static_cast<uint64_t>(kind));
    for (int i = 0; i < 1000; ++i) {
      const Triangle t =
          oracle::make_scene(kind, static_cast<uint64_t>(i), {{0, 0, 0}, 32}, 1).front();
      const Box box = box_near(t, random);
      const bool expected = ours(t, box);
      int order[3] = {0, 1, 2};
      do {
        Triangle turned, renumbered, mirrored = t;
        Box turned_box = box, mirrored_box = box;
        for (int a = 0; a < 3; ++a) {
          for (int v = 0; v < 3; ++v) turned[v][a] = t[v][order[a]];
          turned_box.low[a] = box.low[order[a]];
          renumbered[a] = t[order[a]];
          if (order[a] >= a) continue;
          for (Point& p : mirrored) p[a] = -p[a];
          mirrored_box.low[a] = -box.low[a] - box.edge;
        }
        ASSERT_EQ(ours(turned, turned_box), expected) << i;
        ASSERT_EQ(ours(renumbered, box), expected) << i;
        ASSERT_EQ(ours(mirrored, mirrored_box), expected) << i;
      } while (std::next_permutation(order, order + 3));
    }
  }
}

// Known results: contact in one point counts as touching, and one unit less is a miss.
TEST(Overlap, CountsContacts) {
  const Box box{{0, 0, 0}, 256};
  // The plane x + y = 512 touches the cube in one edge; x + y = 514 passes by.
  EXPECT_TRUE(ours({{{511, 1, 1}, {1, 511, 1}, {1, 511, 255}}}, box));
  EXPECT_FALSE(ours({{{513, 1, 1}, {1, 513, 1}, {1, 513, 255}}}, box));
  // A segment through one corner only.
  EXPECT_TRUE(ours({{{255, 257, 259}, {257, 255, 253}, {255, 257, 259}}}, box));
  EXPECT_FALSE(ours({{{255, 257, 261}, {257, 255, 255}, {255, 257, 261}}}, box));
  // A point inside, and outside.
  EXPECT_TRUE(ours({{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}}, box));
  EXPECT_FALSE(ours({{{257, 1, 1}, {257, 1, 1}, {257, 1, 1}}}, box));
}

}  // namespace
}  // namespace voxdag
