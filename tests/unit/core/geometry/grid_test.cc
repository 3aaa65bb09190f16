#include "core/geometry/grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "core/base/error.h"
#include "tests/support/error_of.h"

namespace voxdag {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

WorldBounds bounds(std::array<double, 3> low, std::array<double, 3> high) {
  WorldBounds b;
  b.low = low;
  b.high = high;
  b.empty = false;
  return b;
}

void expect_error(ErrorCode code, const std::function<void()>& call) {
  try {
    call();
    ADD_FAILURE() << "no error, expected " << error_name(code);
  } catch (const Error& error) {
    EXPECT_STREQ(error_name(error.code()), error_name(code)) << error.message();
  }
}

// Bounds begin empty and are extended by all three vertices of every triangle.
TEST(WorldBounds, GrowByTriangles) {
  WorldBounds b = bounds_of({});
  EXPECT_TRUE(b.empty);
  const WorldTriangle point{{{5, -6, 7}, {5, -6, 7}, {5, -6, 7}}};
  b.add(bounds_of({&point, 1}));
  EXPECT_FALSE(b.empty);
  EXPECT_EQ(b.low, (std::array<double, 3>{5, -6, 7}));
  EXPECT_EQ(b.low, b.high);
  for (int i = 0; i < 3; ++i) {
    WorldTriangle triangles[2] = {point, point};
    triangles[1].v[i][0] = 4;
    triangles[0].v[i][1] = 6;
    const WorldBounds grown = bounds_of(triangles);
    EXPECT_EQ(grown.low, (std::array<double, 3>{4, -6, 7})) << i;
    EXPECT_EQ(grown.high, (std::array<double, 3>{5, 6, 7})) << i;
  }
}

// The expected values were computed manually. They are exact, because all numbers of this test are
// exact in binary.
TEST(Grid, DefaultCubeIsThatOfTheDesign) {
  const Grid grid = Grid::around(bounds({-1, 2, 10}, {7, 4, 11}), 10);
  EXPECT_EQ(grid.levels, 10u);
  EXPECT_EQ(grid.resolution(), 1024);
  EXPECT_EQ(grid.edge, 8.000244140625);  // 8 (1 + 2^-15)
  EXPECT_EQ(grid.origin[0], 3 - 4.0001220703125);
  EXPECT_EQ(grid.origin[1], 3 - 4.0001220703125);
  EXPECT_EQ(grid.origin[2], 10.5 - 4.0001220703125);
}

// The cube depends only on the scene. So a finer grid divides the voxels of a coarser grid, and
// voxels of all resolutions nest.
TEST(Grid, VoxelsNestAcrossResolutions) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 2000; ++i) {
    const double scale = std::ldexp(1.0, static_cast<int>(random() % 60) - 30);
    WorldTriangle t;
    for (auto& vertex : t.v)
      for (double& x : vertex) x = scale * (uniform(random) + (i % 3 ? 0 : 100));
    const WorldBounds b = bounds_of({&t, 1});
    FixedTriangle coarse, fine;
    for (uint32_t levels = 2; levels < 20; ++levels) {
      const Grid grid = Grid::around(b, levels), next = Grid::around(b, levels + 1);
      ASSERT_EQ(grid.edge, next.edge);
      ASSERT_EQ(grid.origin, next.origin);
      ASSERT_EQ(snap_triangle(grid, t, coarse), SnapResult::kInside);
      ASSERT_EQ(snap_triangle(next, t, fine), SnapResult::kInside);
      for (int k = 0; k < 9; ++k) {
        const int64_t u = coarse.v[k / 3][k % 3], w = fine.v[k / 3][k % 3];
        ASSERT_EQ(u & 1, 1);
        ASSERT_EQ(u >> 8, w >> 9) << "levels " << levels;
        ASSERT_TRUE(u > 0 && u < grid.resolution() * kUnitsPerVoxel) << u;
      }
    }
  }
}

// For a scene without triangles or without extent, the grid is a cube of edge 1 around it.
TEST(Grid, WithoutExtentHasEdgeOne) {
  const Grid none = Grid::around(WorldBounds{}, 4);
  EXPECT_EQ(none.edge, 1.0);
  EXPECT_EQ(none.origin, (std::array<double, 3>{-0.5, -0.5, -0.5}));
  const Grid point = Grid::around(bounds({3, 4, 5}, {3, 4, 5}), 4);
  EXPECT_EQ(point.edge, 1.0);
  EXPECT_EQ(point.origin, (std::array<double, 3>{2.5, 3.5, 4.5}));
}

// An extent that exceeds the largest double is an error.
TEST(Grid, ExtentMustBeFinite) {
  const double most = std::numeric_limits<double>::max();
  expect_error(ErrorCode::kLimit, [&] { Grid::around(bounds({-most, 0, 0}, {most, 0, 0}), 4); });
}

// A cube given by the user is used unchanged. Invalid cubes are refused.
TEST(Grid, GivenCube) {
  const Grid grid = Grid::given({1, 2, 3}, 0.3, 5);
  EXPECT_EQ(grid.origin, (std::array<double, 3>{1, 2, 3}));
  EXPECT_EQ(grid.edge, 0.3);
  EXPECT_EQ(grid.levels, 5u);
  for (const double edge : {0.0, -1.0, kInfinity, kNan})
    expect_error(ErrorCode::kInvalidInput, [&] { Grid::given({0, 0, 0}, edge, 5); });
  for (const double x : {kInfinity, -kInfinity, kNan})
    expect_error(ErrorCode::kInvalidInput, [&] { Grid::given({0, x, 0}, 1, 5); });
}

// With --voxel-size V, the grid's edge is V * R, and the grid is centered on the scene. A scene as
// large as the grid or larger is refused.
TEST(Grid, OfAVoxelSize) {
  const WorldBounds b = bounds({0, 10, 20}, {4, 11, 21});
  const Grid grid = Grid::with_voxel_size(b, 0.5, 4);
  EXPECT_EQ(grid.edge, 8.0);
  EXPECT_EQ(grid.origin, (std::array<double, 3>{-2, 6.5, 16.5}));
  expect_error(ErrorCode::kInvalidInput, [&] { Grid::with_voxel_size(b, 0.25, 4); });
  expect_error(ErrorCode::kInvalidInput, [&] { Grid::with_voxel_size(b, 0.125, 4); });
  EXPECT_EQ(Grid::with_voxel_size(WorldBounds{}, 2, 2).edge, 8.0);
  // levels_for_voxel_size() returns the smallest number of levels that is enough for the scene.
  for (const double size : {4.0, 1.0, 0.5, 0.3, 0.25, 1e-5}) {
    const uint32_t levels = Grid::levels_for_voxel_size(b, size);
    EXPECT_EQ(Grid::with_voxel_size(b, size, levels).levels, levels);
    if (levels > 2)
      expect_error(ErrorCode::kInvalidInput, [&] { Grid::with_voxel_size(b, size, levels - 1); });
  }
  EXPECT_EQ(Grid::levels_for_voxel_size(WorldBounds{}, 1e-9), 2u);
  expect_error(ErrorCode::kInvalidInput, [&] { Grid::levels_for_voxel_size(b, 1e-9); });
  for (const double size : {0.0, -1.0, kInfinity, kNan})
    expect_error(ErrorCode::kInvalidInput, [&] { Grid::with_voxel_size(b, size, 4); });
}

// If no grid is fine enough, the error recommends a voxel size with which the scene fits, also if
// the number of levels has a lower limit.
TEST(Grid, RecommendsASufficientVoxelSize) {
  for (const uint32_t max_levels : {20u, 19u})
    for (const double extent :
         {1.0, 11.0, 2000010.0, 0.1, 3.0, 9.999999, 1e-3, 1e300, 1e-300, 5e-310}) {
      const WorldBounds b = bounds({0, 0, 0}, {extent, 0, 0});
      const double size = extent / 1e7;
      const std::string message =
          error_of([&] { Grid::levels_for_voxel_size(b, size, max_levels); }).message();
      const std::string head = "expected a voxel size of at least ";
      ASSERT_NE(message.find(head), std::string::npos) << message;
      EXPECT_NE(message.find("2^" + std::to_string(max_levels)), std::string::npos) << message;
      const double recommended =
          std::strtod(message.substr(message.find(head) + head.size()).c_str(), nullptr);
      EXPECT_EQ(Grid::levels_for_voxel_size(b, recommended, max_levels), max_levels) << message;
      EXPECT_EQ(error_of([&] { Grid::with_voxel_size(b, size, 10, max_levels); }).message(),
                message);
    }
}

// A grid whose origin or edge is not finite is refused, because no command could open its file. An
// earlier version wrote such files.
TEST(GridLimits, AGridOutOfTheRangeOfDoublesIsRefused) {
  const WorldBounds far = bounds({1.5e308, 0, 0}, {1.5e308, 1, 1});
  EXPECT_EQ(error_of([&] { Grid::around(far, 6); }).code(), ErrorCode::kLimit);
  EXPECT_EQ(error_of([&] { Grid::with_voxel_size(far, 1, 6); }).code(), ErrorCode::kLimit);
  EXPECT_EQ(error_of([] { Grid::with_voxel_size({}, 1e308, 10); }).code(), ErrorCode::kLimit);
  EXPECT_TRUE(std::isfinite(Grid::with_voxel_size({}, 1e304, 10).origin[0]));
}

// Resolutions are powers of two from 4 to 2^20 voxels per edge.
TEST(Grid, ResolutionsAreLimited) {
  for (uint32_t levels = 2; levels <= 20; ++levels) {
    EXPECT_EQ(levels_of_resolution(uint64_t{1} << levels), levels);
    EXPECT_NO_THROW(Grid::around(WorldBounds{}, levels));
  }
  for (const uint64_t r : {uint64_t{0}, uint64_t{1}, uint64_t{2}, uint64_t{5}, uint64_t{1023},
                           uint64_t{1} << 21, (uint64_t{1} << 32) + 4, UINT64_MAX})
    expect_error(ErrorCode::kInvalidInput, [&] { levels_of_resolution(r); });
  for (const uint32_t levels : {0u, 1u, 21u, 64u, 0xffffffffu}) {
    expect_error(ErrorCode::kInvalidInput, [&] { Grid::around(WorldBounds{}, levels); });
    expect_error(ErrorCode::kInvalidInput, [&] { Grid::given({0, 0, 0}, 1, levels); });
    expect_error(ErrorCode::kInvalidInput, [&] { Grid::with_voxel_size({}, 1, levels); });
  }
}

}  // namespace
}  // namespace voxdag
