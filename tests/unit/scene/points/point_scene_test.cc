// Each point of a file becomes one degenerate triangle or, if the options have a radius, a cube.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "core/geometry/grid.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

std::string ply_points(const std::string& rows, size_t count, const std::string& more = "") {
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) +
         "\nproperty float x\nproperty float y\nproperty float z\n" + more + "end_header\n" + rows;
}

TEST(Points, PlyWithoutFacesIsPoints) {
  const std::vector<Corners> expected = {{{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}},
                                         {{{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}}};
  EXPECT_EQ(triangles_of_file(ply_points("0 0 0\n1 2 3\n", 2)), expected);
  EXPECT_EQ(triangles_of_file(ply_points("0 0 0\n1 2 3\n", 2,
                                         "element face 0\nproperty list uchar "
                                         "int vertex_indices\n")),
            expected);
  EXPECT_TRUE(triangles_of_file(ply_points("", 0)).empty());
}

TEST(Points, PlyColors) {
  const std::string colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  OpenScene open(ply_points("0 0 0 255 0 0\n1 2 3 0 255 0\n", 2, colors));
  const auto surfaces = surfaces_of(*open.source);
  ASSERT_EQ(surfaces.size(), 2u);
  EXPECT_EQ(surfaces[1].position.v[2][1], 2);
  for (const SurfaceCorner& corner : surfaces[1].corners)
    EXPECT_EQ(corner.color, (std::array<uint16_t, 4>{0, 65535, 0, 65535}));
}

TEST(Points, InvalidPointsAreNamedOrSkipped) {
  const std::string file = ply_points("0 0 0\nnan 0 0\n1 2 3\n", 3);
  EXPECT_THAT(error_of_file(file).message(),
              testing::HasSubstr("vertex 1 is not a finite position"));
  OpenScene open(file, {.skip_invalid = true});
  EXPECT_EQ(open.source->declared_triangles(), 3u);
  EXPECT_EQ(open.triangles().size(), 2u);
}

// The triangles form a closed surface: each edge occurs once in each direction. They enclose the
// volume of the cube.
TEST(Points, CubeIsClosedAndFacesOutward) {
  OpenScene open("1 2 3\n", {.point_radius = 0.5});
  const auto triangles = open.triangles();
  ASSERT_EQ(triangles.size(), 12u);
  std::map<std::pair<std::array<double, 3>, std::array<double, 3>>, int> edges;
  double volume = 0;
  for (const Corners& t : triangles) {
    for (size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
    const auto &a = t[0], &b = t[1], &c = t[2];
    volume += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
               a[2] * (b[0] * c[1] - b[1] * c[0])) /
              6;
  }
  EXPECT_NEAR(volume, 1, 1e-12);
  EXPECT_EQ(edges.size(), 36u);
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(edges.contains({edge.second, edge.first}));
  }
  const WorldBounds bounds = open.source->open(1)->read_bounds(0, 12);
  EXPECT_EQ(bounds.low, (std::array{0.5, 1.5, 2.5}));
  EXPECT_EQ(bounds.high, (std::array{1.5, 2.5, 3.5}));
}

// Any range of triangles can be read, even a part of a cube. read_snapped() gives the same
// triangles with snapped vertices.
TEST(Points, RangesOfCubes) {
  std::string file;
  for (int i = 0; i < 3000; ++i)
    file += std::to_string(i) + " " + std::to_string(i % 7) + " 0.5 " + std::to_string(i % 256) +
            " 0 0\n";
  OpenScene open(file, {.point_radius = 0.25});
  const auto all = open.triangles();
  ASSERT_EQ(all.size(), 36000u);
  const auto cursor = open.source->open(2);
  const Grid grid = Grid::around(cursor->read_bounds(0, 36000), 10);
  for (const auto& [first, count] :
       {std::pair{5u, 20u}, {12283u, 30u}, {35999u, 1u}, {0u, 36000u}}) {
    size_t at = first;
    cursor->read_snapped(first, count, grid, [&](std::span<const RealTriangle> batch) {
      EXPECT_LE(batch.size(), 1024u);
      for (const RealTriangle& t : batch) {
        Corners expected = all[at++];
        for (auto& corner : expected) snap_vertices(grid, corner);
        for (size_t k = 0; k < 3; ++k)
          for (size_t a = 0; a < 3; ++a) ASSERT_EQ(t.v[k][a], expected[k][a]);
      }
    });
    EXPECT_EQ(at, first + count);
    at = first;
    cursor->read_surfaces(first, count, [&](std::span<const SurfaceTriangle> batch) {
      for (const SurfaceTriangle& t : batch) ASSERT_EQ(t.position.v[1][2], all[at++][1][2]);
    });
    EXPECT_EQ(at, first + count);
  }
}

TEST(Points, BoundsOfPoints) {
  OpenScene open("1 2 3\n-1 9 0\n0 0 7\n");
  const WorldBounds bounds = open.source->open(1)->read_bounds(0, 3);
  EXPECT_EQ(bounds.low, (std::array{-1.0, 0.0, 0.0}));
  EXPECT_EQ(bounds.high, (std::array{1.0, 9.0, 7.0}));
}

TEST(Points, InvalidRadiusIsRefused) {
  for (const double radius : {-1.0, std::nan(""), HUGE_VAL})
    EXPECT_THROW(OpenScene("1 2 3\n", {.point_radius = radius}), Error);
  // A cube whose corners are not finite is an invalid point.
  EXPECT_THROW(OpenScene("1 2 1.7e308\n", {.point_radius = 1e308}).triangles(), Error);
}

}  // namespace
}  // namespace voxdag::test
