#include "scheduler/stages/ingest/top_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "scheduler/stages/partition/partition.h"

namespace voxdag {
namespace {

constexpr uint32_t kLevels = 11;  // R = 2048

FixedTriangle triangle_near(std::mt19937_64& random, int64_t size_units) {
  const int64_t grid = int64_t{kUnitsPerVoxel} << kLevels;
  FixedTriangle t;
  int64_t center[3];
  for (int64_t& c : center) c = static_cast<int64_t>(random() % static_cast<uint64_t>(grid));
  for (auto& vertex : t.v)
    for (int a = 0; a < 3; ++a)
      vertex[a] = (center[a] + static_cast<int64_t>(random() % static_cast<uint64_t>(size_units)) -
                   size_units / 2) |
                  1;
  return t;
}

// Returns the indexes of the subvolumes (the leaves of the plan) that the triangle touches, by an
// exact overlap test with each subvolume.
std::vector<size_t> touched_by_brute_force(const FixedTriangle& t,
                                           const std::vector<SubvolumePlan>& leaves) {
  std::vector<size_t> touched;
  for (size_t i = 0; i < leaves.size(); ++i) {
    const int64_t units = leaves[i].cube.edge_voxels(kLevels) * kUnitsPerVoxel;
    int64_t low[3];
    for (int a = 0; a < 3; ++a) low[a] = static_cast<int64_t>(leaves[i].cube.position[a]) * units;
    if (triangle_touches_cube(t, low, units)) touched.push_back(i);
  }
  return touched;
}

ExpectedWork expected_work(const FixedTriangle& t) {
  SnappedTriangle snapped;
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) snapped.v[i][a] = static_cast<double>(t.v[i][a]);
  return voxdag::expected_work(snapped);
}

void add(TopTree& top, const FixedTriangle& t) {
  TopTree::Tally tally(top);
  tally.add(t, expected_work(t).bricks);
  top.add(tally);
}

// Triangles that are counted together in one tally give the same top tree as triangles in separate
// tallies.
TEST(TopTree, OneTallyOrMany) {
  MemoryBudget budget(uint64_t{1} << 30);
  TopTree one(kLevels, budget, 5), many(kLevels, budget, 5);
  TopTree::Tally tally(one);
  std::mt19937_64 random(1);
  for (int piece = 0; piece < 3; ++piece) {
    tally.clear();
    for (int cluster = 0; cluster < 20; ++cluster) {
      const FixedTriangle first = triangle_near(random, 900);
      for (int i = 0; i < 50; ++i) {
        FixedTriangle t = first;
        for (auto& vertex : t.v)
          for (int64_t& u : vertex) u += 2 * static_cast<int64_t>(random() % 9000);
        tally.add(t, expected_work(t).bricks);
        add(many, t);
      }
    }
    one.add(tally);
  }
  const auto a = one.subvolumes_by_edge(64), b = many.subvolumes_by_edge(64);
  ASSERT_EQ(a.size(), b.size());
  EXPECT_GT(a.size(), 60u);
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].cube, b[i].cube);
    EXPECT_EQ(a[i].triangles, b[i].triangles);
    EXPECT_NEAR(a[i].weight, b[i].weight, 1e-3 * b[i].weight);
  }
}

// For any division into subvolumes, CubeTree assigns a triangle to all subvolumes that it touches.
// Each triangle that touches the grid touches a subvolume of the plan.
TEST(TopTree, PlansCoverAllThatTrianglesTouch) {
  MemoryBudget budget(uint64_t{1} << 30);
  for (const int64_t size : {int64_t{600}, int64_t{40000}, int64_t{900000}}) {
    std::mt19937_64 random(static_cast<uint64_t>(size));
    TopTree top(kLevels, budget, TopTree::depth_within(kLevels, 1 << 20));
    std::vector<FixedTriangle> triangles;
    for (int i = 0; i < 60; ++i) triangles.push_back(triangle_near(random, size));
    for (const FixedTriangle& t : triangles) add(top, t);
    for (const auto& leaves :
         {top.subvolumes_by_edge(256), top.subvolumes_by_edge(64), top.subvolumes_by_edge(2048),
          top.subvolumes_by_weight({.weight = top.total_weight() / 20})}) {
      SCOPED_TRACE(testing::Message() << "size " << size << ", leaves " << leaves.size());
      std::vector<Cube> cubes;
      for (const SubvolumePlan& leaf : leaves) cubes.push_back(leaf.cube);
      const CubeTree tree(kLevels, Cube{}, cubes);
      CubeTree::Hint hint;
      for (const FixedTriangle& t : triangles) {
        std::vector<size_t> got;
        tree.for_each_touched(t, hint, [&](size_t leaf) { got.push_back(leaf); });
        std::sort(got.begin(), got.end());
        // The tree must find all touched leaves. It can also find a leaf that the triangle does not
        // touch, because it does not test the overlap if one cube contains the triangle's bounding
        // box.
        const auto touched = touched_by_brute_force(t, leaves);
        EXPECT_TRUE(std::includes(got.begin(), got.end(), touched.begin(), touched.end()));
        const int64_t origin[3] = {0, 0, 0};
        if (triangle_touches_cube(t, origin, int64_t{kUnitsPerVoxel} << kLevels)) {
          EXPECT_FALSE(touched.empty());
        }
      }
    }
  }
}

// CubeTree finds the octants of a split cube that each triangle touches, even for triangles that
// extend beyond the cube.
TEST(CubeTree, FindsThePartsOfACubeThatTrianglesTouch) {
  const Cube whole{2, {1, 2, 1}};
  std::vector<SubvolumePlan> parts;
  std::vector<Cube> cubes;
  for (int c = 0; c < 8; ++c) {
    cubes.push_back(whole.child(c));
    parts.push_back({cubes.back(), 0, 0});
  }
  const CubeTree tree(kLevels, whole, cubes);
  CubeTree::Hint hint;
  const int64_t units = whole.edge_voxels(kLevels) * kUnitsPerVoxel;
  int64_t low[3];
  for (int a = 0; a < 3; ++a) low[a] = static_cast<int64_t>(whole.position[a]) * units;
  std::mt19937_64 random(7);
  int touching = 0, beyond = 0;
  for (int i = 0; i < 20000; ++i) {
    const FixedTriangle t = triangle_near(random, i % 2 == 0 ? 4000 : 200000);
    if (!triangle_touches_cube(t, low, units)) continue;
    ++touching;
    for (int a = 0; a < 3; ++a)
      if (t.low(a) < low[a] || t.high(a) > low[a] + units) {
        ++beyond;
        break;
      }
    std::vector<size_t> got;
    tree.for_each_touched(t, hint, [&](size_t leaf) { got.push_back(leaf); });
    std::sort(got.begin(), got.end());
    EXPECT_EQ(got, touched_by_brute_force(t, parts));
  }
  EXPECT_GT(touching, 50);
  EXPECT_GT(beyond, 20);
}

// A triangle of any size is counted in exactly the cells that it touches.
TEST(TopTree, CountsTheCellsThatTrianglesTouch) {
  constexpr uint32_t kDepth = 4;
  std::mt19937_64 random(11);
  for (const int64_t size : {int64_t{3000}, int64_t{30000}, int64_t{120000}, int64_t{900000}})
    for (int i = 0; i < 100; ++i) {
      MemoryBudget budget(uint64_t{1} << 30);
      TopTree top(kLevels, budget, kDepth);
      const FixedTriangle t = triangle_near(random, size);
      add(top, t);
      const int64_t units = (int64_t{kUnitsPerVoxel} << kLevels) >> kDepth;
      uint64_t touched = 0;
      for (int64_t x = 0; x < 1 << kDepth; ++x)
        for (int64_t y = 0; y < 1 << kDepth; ++y)
          for (int64_t z = 0; z < 1 << kDepth; ++z) {
            const int64_t corner[3] = {x * units, y * units, z * units};
            touched += triangle_touches_cube(t, corner, units);
          }
      // It is possible that a triangle that touches no cell is counted, because the overlap is not
      // tested if one cell contains its bounding box.
      if (touched > 0) {
        EXPECT_EQ(top.occupied_cells(), touched) << "size " << size << ", " << i;
      }
    }
}

// The cubes of a plan by weight are disjoint. A cube is heavier than requested only if it is a
// single cell of the top tree, which cannot be divided.
TEST(TopTree, PlansAreDisjointAndWithinTheirWeight) {
  MemoryBudget budget(uint64_t{1} << 30);
  std::mt19937_64 random(3);
  const uint32_t depth = TopTree::depth_within(kLevels, 1 << 20);
  TopTree top(kLevels, budget, depth);
  for (int i = 0; i < 2000; ++i) add(top, triangle_near(random, 5000));
  const double most = top.total_weight() / 100;
  const auto plan = top.subvolumes_by_weight({.weight = most});
  EXPECT_GT(plan.size(), 100u);
  double sum = 0;
  for (size_t i = 0; i < plan.size(); ++i) {
    sum += plan[i].weight;
    if (plan[i].cube.level < depth) {
      EXPECT_LE(plan[i].weight, most);
    }
    for (size_t j = 0; j < i; ++j) {
      const Cube *a = &plan[i].cube, *b = &plan[j].cube;
      if (a->level < b->level) std::swap(a, b);
      EXPECT_FALSE(ancestor(*a, b->level) == *b);
    }
  }
  EXPECT_NEAR(sum, top.total_weight(), 0.01 * top.total_weight());
}

// The limit `flat_weight` applies only to flat subvolumes, whose triangles are large. With it, a
// plan for one large triangle has fewer and heavier subvolumes. A plan for small triangles is
// unchanged.
TEST(TopTree, FlatSubvolumesHaveASeparateLimit) {
  MemoryBudget budget(uint64_t{1} << 30);
  constexpr int64_t kGrid = int64_t{kUnitsPerVoxel} << kLevels;
  TopTree large(kLevels, budget, 2), small(kLevels, budget, 2);
  add(large, {{{1, 1, 1}, {kGrid - 1, 1, 1}, {1, kGrid - 1, 1}}});
  std::mt19937_64 random(5);
  for (int i = 0; i < 2000; ++i) add(small, triangle_near(random, 5000));
  for (const TopTree* top : {&large, &small}) {
    const double most = top->total_weight() / 8;
    const auto plan = top->subvolumes_by_weight({.weight = most});
    const auto flat = top->subvolumes_by_weight({.weight = most, .flat_weight = 4 * most});
    EXPECT_EQ(flat.size() < plan.size(), top == &large);
    for (const SubvolumePlan& s : flat) EXPECT_LE(s.weight, 4 * most);
  }
}

// The expected number of voxels of a triangle is the volume of its Minkowski sum with a voxel. For
// a right triangle with two edges along axes, a formula for this volume is known.
TEST(TopTree, ExpectedVoxelsOfAnAxisAlignedTriangle) {
  FixedTriangle t{{{1, 1, 1}, {1 + 256 * 100, 1, 1}, {1, 1 + 256 * 50, 1}}};
  EXPECT_NEAR(expected_work(t).voxels, 0.5 * 100 * 50 + 100 + 50 + 1, 1e-6);
  EXPECT_NEAR(expected_work(t).bricks, 0.5 * 25 * 12.5 + 25 + 12.5 + 1, 1e-6);
}

// A tally of many triangles gives the same weights as one tally per triangle, also if the tally is
// used again after clear().
TEST(TopTree, TalliesAddUp) {
  MemoryBudget budget(uint64_t{1} << 30);
  std::mt19937_64 random(5);
  const uint32_t depth = TopTree::depth_within(kLevels, 1 << 20);
  TopTree one_by_one(kLevels, budget, depth), by_tally(kLevels, budget, depth);
  TopTree::Tally tally(by_tally);
  for (int piece = 0; piece < 3; ++piece) {
    tally.clear();
    for (int i = 0; i < 1000; ++i) {
      const FixedTriangle t = triangle_near(random, i % 10 == 0 ? 400000 : 5000);
      add(one_by_one, t);
      tally.add(t, expected_work(t).bricks);
    }
    by_tally.add(tally);
  }
  EXPECT_NEAR(by_tally.total_weight(), one_by_one.total_weight(), 1e-5 * one_by_one.total_weight());
  const auto plan = by_tally.subvolumes_by_edge(64), expected = one_by_one.subvolumes_by_edge(64);
  ASSERT_EQ(plan.size(), expected.size());
  for (size_t i = 0; i < plan.size(); ++i) {
    EXPECT_EQ(plan[i].cube, expected[i].cube);
    EXPECT_EQ(plan[i].triangles, expected[i].triangles);
    EXPECT_NEAR(plan[i].weight, expected[i].weight, 1e-4 * expected[i].weight);
  }
}

// If a top tree begins with the cells of another top tree, as when ingest resumes, it gives the
// same plans as a single top tree that counts all triangles.
TEST(TopTree, ContinuesFromTheCellsOfAnother) {
  MemoryBudget budget(uint64_t{1} << 30);
  std::mt19937_64 random(4);
  const uint32_t depth = TopTree::depth_within(kLevels, 1 << 20);
  TopTree whole(kLevels, budget, depth), first(kLevels, budget, depth),
      rest(kLevels, budget, depth);
  for (int i = 0; i < 2000; ++i) {
    const FixedTriangle triangle = triangle_near(random, 5000);
    if (i == 700) std::ranges::copy(first.cells(), rest.fill(first.total_weight()).begin());
    add(whole, triangle);
    add(i < 700 ? first : rest, triangle);
  }
  EXPECT_EQ(rest.total_weight(), whole.total_weight());
  const auto plan = whole.subvolumes_by_weight({.weight = whole.total_weight() / 50});
  const auto again = rest.subvolumes_by_weight({.weight = whole.total_weight() / 50});
  ASSERT_EQ(plan.size(), again.size());
  for (size_t i = 0; i < plan.size(); ++i) {
    EXPECT_EQ(plan[i].cube, again[i].cube);
    EXPECT_EQ(plan[i].weight, again[i].weight);
    EXPECT_EQ(plan[i].triangles, again[i].triangles);
  }
}

}  // namespace
}  // namespace voxdag
