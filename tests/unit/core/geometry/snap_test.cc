#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/geometry/grid.h"

namespace voxdag {
namespace {

// Returns a grid of 16 voxels of edge 1, so that positions in the world equal positions in voxels.
Grid plain_grid() { return Grid::given({0, 0, 0}, 16, 4); }

WorldTriangle at(double x, double y, double z) { return {{{x, y, z}, {x, y, z}, {x, y, z}}}; }

int64_t snapped(double x) {
  FixedTriangle out{};
  EXPECT_EQ(snap_triangle(plain_grid(), at(x, 1, 1), out), SnapResult::kInside) << x;
  return out.v[0][0];
}

// A voxel has 128 slices along each axis. u = 2 floor(128 x) + 1 (grid.h) is the middle of the
// slice that contains x, in units of 1/256 voxel.
TEST(Snap, GoesToTheMiddleOfASlice) {
  EXPECT_EQ(snapped(0.0), 1);
  EXPECT_EQ(snapped(std::nextafter(1 / 128.0, 0)), 1);
  EXPECT_EQ(snapped(1 / 128.0), 3);
  EXPECT_EQ(snapped(std::nextafter(1.0, 0)), 255);
  EXPECT_EQ(snapped(1.0), 257);
  EXPECT_EQ(snapped(std::nextafter(16.0, 0)), 4095);
}

// A snapped vertex is never on a voxel's boundary, and is in the same voxel as before.
TEST(Snap, IsOddAndStaysInItsVoxel) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> uniform(0, 16);
  for (int i = 0; i < 20000; ++i) {
    double x = uniform(random);
    if (i % 3 == 0) x = std::floor(x);
    if (i % 3 == 1) x = std::nextafter(std::ceil(x), 0);
    const int64_t u = snapped(x);
    ASSERT_EQ(u & 1, 1);
    ASSERT_EQ(u >> kUnitBits, static_cast<int64_t>(std::floor(x))) << x;
  }
}

// Compares snapping with its formula, written out operation by operation, for a grid whose origin
// and edge are not round numbers.
TEST(Snap, IsThatOfTheDesign) {
  std::mt19937_64 random(12);
  std::uniform_real_distribution<double> uniform(-3, 5);
  const double origin = -2.718281828, edge = 7.3890560989;
  const Grid grid = Grid::given({origin, origin, origin}, edge, 13);
  for (int i = 0; i < 2000; ++i) {
    WorldTriangle world;
    for (auto& v : world.v)
      for (double& x : v) x = uniform(random);
    FixedTriangle out;
    ASSERT_EQ(snap_triangle(grid, world, out), SnapResult::kInside);
    for (int k = 0; k < 9; ++k) {
      volatile double x = world.v[k / 3][k % 3] - origin;
      x = x / edge;
      x = x * 8192.0;
      ASSERT_EQ(out.v[k / 3][k % 3], 2 * static_cast<int64_t>(std::floor(128.0 * x)) + 1);
    }
  }
}

// A triangle is dropped if its bounding box misses the grid on any side. It is kept if the box
// touches the grid.
TEST(Snap, DropsWhatMissesTheGrid) {
  FixedTriangle out;
  const double below = -1e-300, above = 16.0;
  for (int axis = 0; axis < 3; ++axis)
    for (const double off : {below, above, -5.0, 1e6, -1e300, 1e300}) {
      double p[3] = {1, 1, 1};
      p[axis] = off;
      EXPECT_EQ(snap_triangle(plain_grid(), at(p[0], p[1], p[2]), out), SnapResult::kOutside)
          << axis << ' ' << off;
    }
  const WorldTriangle around{{{-100, -100, 8}, {100, -100, 8}, {0, 100, 8}}};
  EXPECT_EQ(snap_triangle(plain_grid(), around, out), SnapResult::kInside);
  EXPECT_EQ(out.v[0][0], -25599);
}

// Snapping returns kTooFar if a lattice coordinate u (grid.h) has |u| >= 2^40, unless the triangle
// misses the grid. u = 2 * floor(128 * x) + 1, so x = -2^32 gives u = 1 - 2^40, which is allowed.
TEST(Snap, TellsWhatReachesTooFar) {
  FixedTriangle out;
  const double limit = 0x1p32;  // 2^40 units
  const auto reach = [&](double x) {
    const WorldTriangle t{{{1, 1, 1}, {1, 2, 1}, {x, 1, 1}}};
    return snap_triangle(plain_grid(), t, out);
  };
  EXPECT_EQ(reach(std::nextafter(limit, 0)), SnapResult::kInside);
  EXPECT_EQ(out.v[2][0], kCoordinateLimit - 1);
  EXPECT_EQ(reach(limit), SnapResult::kTooFar);
  EXPECT_EQ(reach(-limit), SnapResult::kInside);
  EXPECT_EQ(out.v[2][0], 1 - kCoordinateLimit);
  EXPECT_EQ(reach(-limit - 0.01), SnapResult::kTooFar);
  EXPECT_EQ(reach(std::numeric_limits<double>::max()), SnapResult::kTooFar);
  EXPECT_EQ(reach(-std::numeric_limits<double>::max()), SnapResult::kTooFar);
  const WorldTriangle far_away{{{limit, 1, 1}, {2 * limit, 2, 1}, {limit, 1, 1}}};
  EXPECT_EQ(snap_triangle(plain_grid(), far_away, out), SnapResult::kOutside);
}

// If a vertex is far from the origin of a tiny grid, the quotient overflows. The result is still
// defined, because infinity is never cast to an integer.
TEST(Snap, SurvivesOverflow) {
  FixedTriangle out;
  const Grid tiny = Grid::given({0, 0, 0}, 1e-300, 20);
  EXPECT_EQ(snap_triangle(tiny, at(1e300, 0, 0), out), SnapResult::kOutside);
  const WorldTriangle through{{{-1e300, 0, 0}, {1e300, 0, 0}, {0, 0, 0}}};
  EXPECT_EQ(snap_triangle(tiny, through, out), SnapResult::kTooFar);
}

}  // namespace
}  // namespace voxdag
