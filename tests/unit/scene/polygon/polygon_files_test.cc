// The same polygons in PLY, OBJ and ASCII STL files have the same triangles.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/color/surface.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// The corners of polygons as text, three numbers each.
using Polygons = std::vector<std::vector<std::string>>;

std::string ply_of(const Polygons& polygons) {
  std::string vertices, faces;
  int count = 0;
  for (const auto& polygon : polygons) {
    faces += std::to_string(polygon.size());
    for (const std::string& xyz : polygon) {
      vertices += xyz + "\n";
      faces += " " + std::to_string(count++);
    }
    faces += "\n";
  }
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) +
         "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
         std::to_string(polygons.size()) +
         "\nproperty list uint uint vertex_indices\nend_header\n" + vertices + faces;
}

// Each face follows its vertices. Indices are alternately positive and negative.
std::string obj_of(const Polygons& polygons) {
  std::string text;
  size_t count = 0;
  for (const auto& polygon : polygons) {
    for (const std::string& xyz : polygon) text += "v " + xyz + "\n";
    count += polygon.size();
    text += "f";
    for (size_t left = polygon.size(); left > 0; --left)
      text += count % 2 == 0 ? " -" + std::to_string(left) : " " + std::to_string(count - left + 1);
    text += "\n";
  }
  return text;
}

std::string stl_of(const Polygons& polygons) {
  std::string text = "solid polygons\n";
  for (const auto& polygon : polygons) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const std::string& xyz : polygon) text += "vertex " + xyz + "\n";
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid polygons\n";
}

// Thousands of polygons of 3 to 9 corners around the y axis: convex, star-shaped, and some whose
// edges cross each other.
Polygons random_polygons() {
  std::mt19937 random(7);
  Polygons polygons;
  for (int i = 0; i < 3000; ++i) {
    auto& polygon = polygons.emplace_back();
    const int corners = 3 + static_cast<int>(random() % 7);
    for (int k = 0; k < corners; ++k) {
      const double radius = i % 3 == 0 ? 1 : 0.001 + static_cast<double>(random() % 1000) / 1000;
      const double angle = 6.28318 / corners * (i % 10 == 9 ? 2 * k : k);
      polygon.push_back(std::to_string(radius * std::cos(angle)) + " " + std::to_string(i) + " " +
                        std::to_string(radius * std::sin(angle)));
    }
  }
  return polygons;
}

TEST(PolygonFiles, HaveTheSameTriangles) {
  const Polygons polygons = random_polygons();
  OpenScene ply(ply_of(polygons));
  const std::vector<Corners> expected = ply.triangles();
  ASSERT_EQ(ply.source->warnings().size(), 1u);
  const Warning crossing = ply.source->warnings()[0];
  EXPECT_EQ(crossing.code, "crossing-edges");
  for (const std::string& file : {obj_of(polygons), stl_of(polygons)}) {
    OpenScene open(file);
    EXPECT_EQ(open.triangles(), expected);
    ASSERT_EQ(open.source->warnings().size(), 1u);
    EXPECT_EQ(open.source->warnings()[0].code, crossing.code);
    EXPECT_EQ(open.source->warnings()[0].count, crossing.count);
    const auto cursor = open.source->open(2);
    for (uint64_t first = expected.size(); first-- > 0; first -= std::min<uint64_t>(first, 97))
      cursor->read(first, 1, [&](auto batch) {
        EXPECT_EQ(batch[0].v[2][2], expected[static_cast<size_t>(first)][2][2]);
      });
  }
}

TEST(PolygonFiles, ConcaveFacesAreDividedInside) {
  const Polygons arrow = {{"0 0 0", "2 1 5", "0 2 0", "1 1 2.5"}};
  const std::array<double, 3> inner{1, 1, 2.5};
  for (const std::string& file : {ply_of(arrow), obj_of(arrow), stl_of(arrow)}) {
    OpenScene open(file);
    const std::vector<Corners> triangles = open.triangles();
    ASSERT_EQ(triangles.size(), 2u);
    for (const Corners& corners : triangles) EXPECT_EQ(std::ranges::count(corners, inner), 1);
    EXPECT_TRUE(open.source->warnings().empty());
  }
}

TEST(PolygonFiles, CrossedObjAndStlFacesAreNamed) {
  const Polygons polygons = {{"0 0 0", "1 0 0", "0 1 0"}, {"0 0 0", "1 1 0", "1 0 0", "0 1 0"}};
  EXPECT_THAT(texts_of(OpenScene(obj_of(polygons)).source->warnings()),
              ElementsAre(HasSubstr("face 1 in line 9: its edges cross each other")));
  EXPECT_THAT(texts_of(OpenScene(stl_of(polygons)).source->warnings()),
              ElementsAre(HasSubstr("line 11: the edges of a facet cross each other")));
}

// If a vertex is missing or not finite, the error names the face. With skip_invalid, later faces
// are read.
TEST(PolygonFiles, InvalidVerticesOfObjPolygons) {
  const std::string file = "v 0 0 0\nv 4 1 0\nv 0 2 0\nv 1 1 0\nv nan 0 0\nf 1 2 3 9\nf 1 2 5 4\n";
  EXPECT_THAT(error_of_file(file).message(), HasSubstr("face 0 in line 6: index 9"));
  OpenScene open(file + "f 1 2 3 4\n", {.skip_invalid = true});
  EXPECT_EQ(open.source->declared_triangles(), 6u);
  EXPECT_EQ(open.triangles().size(), 3u);
}

// The corners of a concave polygon keep their colors.
TEST(PolygonFiles, ColorsOfConcaveObjPolygons) {
  OpenScene open("v 0 0 0 0 0 0\nv 4 1 0 0 0 0\nv 0 2 0 0 0 0\nv 1 1 0 1 0 0\nf 1 2 3 4\n");
  const auto all = surfaces_of(*open.source);
  ASSERT_EQ(all.size(), 2u);
  for (const SurfaceTriangle& triangle : all)
    for (size_t k = 0; k < 3; ++k)
      EXPECT_EQ(triangle.corners[k].color[0], triangle.position.v[k][0] == 1 ? kFullIntensity : 0);
}

}  // namespace
}  // namespace voxdag::test
