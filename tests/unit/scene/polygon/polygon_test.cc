// Triangulation of polygons: the triangles cover the polygon and nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <random>

#include "core/base/error.h"
#include "scene/polygon/triangulator.h"

namespace voxdag::test {
namespace {

using Outline = std::vector<std::array<double, 2>>;

double area(const Outline& p, size_t a, size_t b, size_t c) {
  return ((p[b][0] - p[a][0]) * (p[c][1] - p[a][1]) - (p[b][1] - p[a][1]) * (p[c][0] - p[a][0])) /
         2;
}

// Places the outline in a tilted plane. All coordinates remain exact.
std::vector<double> in_space(const Outline& outline) {
  std::vector<double> xyz;
  for (const auto& [x, y] : outline) xyz.insert(xyz.end(), {y / 4, x, x / 2 - y});
  return xyz;
}

// Triangulates the outline. Checks that all triangles have the outline's orientation, and that
// their areas sum to the outline's area, so that they cover it without overlap. Returns false,
// without checks, if the triangulator reports the outline as doubtful (its edges cross).
bool is_covered(const Outline& outline) {
  MemoryBudget budget(uint64_t{64} << 20);
  polygon::Triangulator triangulator(budget, "a test");
  std::vector<double> xyz = in_space(outline);
  const bool is_split = triangulator.triangulate(xyz);
  if (triangulator.is_doubtful()) return false;
  double all = 0, sum = 0;
  std::vector<uint32_t> fan;
  for (uint32_t k = 1; k + 1 < outline.size(); ++k) {
    fan.insert(fan.end(), {0, k, k + 1});
    all += area(outline, 0, k, k + 1);
  }
  const std::vector<uint32_t> triangles(
      is_split ? std::vector(triangulator.triangles().begin(), triangulator.triangles().end())
               : fan);
  EXPECT_EQ(triangles.size(), 3 * (outline.size() - 2));
  const double noise = 1e-9 * std::fabs(all);
  for (size_t i = 0; i < triangles.size(); i += 3) {
    const double part = area(outline, triangles[i], triangles[i + 1], triangles[i + 2]);
    EXPECT_GE(all > 0 ? part : -part, -noise);
    sum += part;
  }
  EXPECT_NEAR(sum, all, noise);
  return true;
}

// Checks the outline with each of its corners as the first, in both directions.
void check_all_ways(Outline outline) {
  for (int direction = 0; direction < 2; ++direction) {
    for (size_t i = 0; i < outline.size(); ++i) {
      ASSERT_TRUE(is_covered(outline)) << "from corner " << i;
      std::rotate(outline.begin(), outline.begin() + 1, outline.end());
    }
    std::ranges::reverse(outline);
  }
}

TEST(Polygon, ConcaveShapesAreCovered) {
  check_all_ways({{0, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 4}, {0, 4}});
  check_all_ways({{0, 0}, {6, 0}, {6, 6}, {5, 6}, {5, 1}, {1, 1}, {1, 6}, {0, 6}});
  check_all_ways({{0, 0}, {2, 1}, {0, 4}, {-2, 1}});
  check_all_ways({{0, 0}, {4, 1}, {0, 2}, {1, 1}});
  check_all_ways({{0, 0}, {1, 3}, {2, 0}, {3, 3}, {4, 0}, {4, 5}, {0, 5}});
}

// Outlines with corners on straight edges, repeated corners and spikes are covered.
TEST(Polygon, CollinearCornersAreCovered) {
  check_all_ways({{0, 0}, {2, 0}, {4, 0}, {4, 1}, {2, 1}, {1, 1}, {1, 4}, {0, 4}, {0, 2}});
  check_all_ways({{0, 0}, {4, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 1}, {1, 1}, {1, 4}, {0, 4}});
  check_all_ways({{0, 0}, {4, 0}, {7, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 4}, {0, 4}});
  check_all_ways({{0, 0}, {1, 0}, {2, 0}, {1, 0}});
  check_all_ways({{3, 3}, {3, 3}, {3, 3}, {3, 3}});
}

// Outlines with holes are covered. The two edges of the bridge to each hole coincide.
TEST(Polygon, HolesWithBridgesAreCovered) {
  check_all_ways({{0, 0}, {9, 0}, {9, 9}, {0, 9}, {0, 0}, {3, 3}, {3, 6}, {6, 6}, {6, 3}, {3, 3}});
  Outline plate = {{0, 0}, {410, 0}, {410, 10}};
  for (int hole = 40; hole >= 0; --hole) {
    const double x = 10 * hole + 5;
    plate.push_back({x, 10});
    for (int i = 0; i <= 16; ++i) {
      const double turn = std::numbers::pi * (0.5 - i % 16 / 8.0);
      plate.push_back(
          {x + std::round(64 * std::cos(turn)) / 32, 5 + std::round(64 * std::sin(turn)) / 32});
    }
    plate.push_back({x, 10});
  }
  plate.push_back({0, 10});
  EXPECT_TRUE(is_covered(plate));
}

// Outlines whose parts touch at corners and along edges are covered.
TEST(Polygon, TouchingPartsAreCovered) {
  check_all_ways({{0, 0}, {4, 0}, {4, 4}, {2, 2}, {0, 4}, {0, 3}, {2, 2}, {0, 1}});
  check_all_ways({{0, 0}, {6, 0}, {6, 4}, {4, 4}, {4, 2}, {2, 2}, {2, 4}, {4, 4}, {4, 5}, {0, 5}});
}

TEST(Polygon, RandomStarsAreCovered) {
  std::mt19937 random(1);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  for (int n = 4; n < 300; ++n) {
    Outline star;
    for (int i = 0; i < n; ++i) {
      const double turn = 2 * std::numbers::pi * (i + 0.8 * unit()) / n, radius = 0.1 + unit();
      star.push_back(
          {std::round(1e6 * radius * std::cos(turn)), std::round(1e6 * radius * std::sin(turn))});
    }
    ASSERT_TRUE(is_covered(star)) << n;
  }
}

// Outlines of 30,000 corners, for which a method of quadratic cost would be slow, are covered.
TEST(Polygon, LargeShapesAreCovered) {
  const auto begin = std::chrono::steady_clock::now();
  Outline spiral, comb, slanted;
  for (int i = 0; i < 15000; ++i)
    spiral.push_back({(1 + i) * std::cos(0.05 * i), (1 + i) * std::sin(0.05 * i)});
  for (int i = 15000; i-- > 0;)
    spiral.push_back({(20 + i) * std::cos(0.05 * i), (20 + i) * std::sin(0.05 * i)});
  EXPECT_TRUE(is_covered(spiral));
  for (int i = 0; i < 30000; ++i) comb.push_back({i % 2 ? 1.0 : 100 + i * 7919 % 1000, 1.0 * i});
  comb.push_back({0, 29999});
  comb.push_back({0, 0});
  EXPECT_TRUE(is_covered(comb));
  for (const auto& [x, y] : comb) slanted.push_back({y, x + 3 * y});
  EXPECT_TRUE(is_covered(slanted));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
}

// A polygon is divided into the fan of triangles from its first corner if this fan covers the
// polygon. This holds for convex polygons, and for other polygons whose first corner sees every
// point. It also holds for polygons whose coordinates are floats and that are convex up to
// rounding.
TEST(Polygon, FansAreKept) {
  MemoryBudget budget(uint64_t{64} << 20);
  polygon::Triangulator triangulator(budget, "a test");
  const auto is_fan = [&](std::vector<double> xyz) {
    return !triangulator.triangulate(xyz) && !triangulator.is_doubtful();
  };
  EXPECT_TRUE(is_fan(in_space({{0, 0}, {2, 0}, {3, 1}, {2, 2}, {0, 2}})));
  EXPECT_TRUE(is_fan(in_space({{1, 1}, {0, 4}, {0, 0}, {4, 0}})));
  EXPECT_FALSE(is_fan(in_space({{0, 0}, {4, 1}, {0, 2}, {1, 1}})));
  std::mt19937 random(2);
  const auto rounded = [](double x, double y, double z) {
    return std::array<double, 3>{static_cast<float>(x), static_cast<float>(y),
                                 static_cast<float>(z)};
  };
  for (int i = 0; i < 1000; ++i) {
    const double a = static_cast<double>(random()), b = static_cast<double>(random());
    std::vector<double> xyz;
    for (const auto& [s, t] : Outline{{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 1}, {3, 3}, {0, 3}}) {
      const auto p =
          rounded(50 + s * std::cos(a) - t * std::sin(a) * std::cos(b),
                  -20 + s * std::sin(a) + t * std::cos(a) * std::cos(b), t * std::sin(b));
      xyz.insert(xyz.end(), p.begin(), p.end());
    }
    ASSERT_TRUE(is_fan(xyz));
  }
}

TEST(Polygon, CrossingEdgesAreDoubtful) {
  EXPECT_FALSE(is_covered({{0, 0}, {1, 1}, {1, 0}, {0, 1}}));
  EXPECT_FALSE(is_covered({{0, 0}, {4, 0}, {0, 3}, {4, 3}, {4, 1}}));
  EXPECT_FALSE(is_covered({{0, 5}, {3, -4}, {-5, 2}, {5, 2}, {-3, -4}}));
}

// Very small and very large coordinates give a defined result.
TEST(Polygon, ExtremeCoordinates) {
  MemoryBudget budget(uint64_t{64} << 20);
  polygon::Triangulator triangulator(budget, "a test");
  for (const double scale : {1e-310, 1e-200, 1e200, 1e308}) {
    std::vector<double> xyz;
    for (const auto& [x, y] : Outline{{0, 0}, {1, 0.25}, {0, 0.5}, {0.5, 0.25}})
      xyz.insert(xyz.end(), {x * scale, 0, y * scale});
    ASSERT_TRUE(triangulator.triangulate(xyz)) << scale;
    EXPECT_EQ(triangulator.triangles().size(), 6u);
  }
  for (const double bad : {std::nan(""), HUGE_VAL}) {
    std::vector<double> xyz = in_space({{0, 0}, {4, 1}, {0, bad}, {1, 1}});
    EXPECT_FALSE(triangulator.triangulate(xyz));
    EXPECT_FALSE(triangulator.is_doubtful());
  }
}

TEST(Polygon, MemoryIsCharged) {
  MemoryBudget budget(uint64_t{200} << 10);
  polygon::Triangulator triangulator(budget, "a polygon of scene.ply");
  Outline comb;
  for (int i = 0; i < 3000; ++i) comb.push_back({i % 2 ? 1.0 : 100, 1.0 * i});
  comb.push_back({0, 2999});
  comb.push_back({0, 0});
  std::vector<double> xyz = in_space(comb);
  EXPECT_THROW(triangulator.triangulate(xyz), Error);
}

}  // namespace
}  // namespace voxdag::test
