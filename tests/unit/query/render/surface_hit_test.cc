#include "query/render/surface_hit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "query/rays/ray_caster.h"
#include "query/render/views.h"
#include "tests/unit/query/voxel_scene.h"

using namespace voxdag::query;

namespace {

double degrees_between(const Vec& a, const Vec& b) {
  return std::acos(std::min(1.0, dot(normalized(a), normalized(b)))) * 180 / 3.14159265358979;
}

// Returns the voxels on the six sides of a box.
std::set<VoxelScene::Voxel> shell(const VoxelScene::Voxel& low, const VoxelScene::Voxel& high) {
  std::set<VoxelScene::Voxel> voxels;
  for (int64_t x = low[0]; x <= high[0]; ++x)
    for (int64_t y = low[1]; y <= high[1]; ++y)
      for (int64_t z = low[2]; z <= high[2]; ++z)
        if (x == low[0] || x == high[0] || y == low[1] || y == high[1] || z == low[2] ||
            z == high[2])
          voxels.insert({x, y, z});
  return voxels;
}

// The normal of a wall is perpendicular to it and points to the visible side.
TEST(SurfaceHit, NormalOfAWall) {
  const VoxelScene scene = VoxelScene::wall(6, 30);
  const DagView dag = scene.view();
  for (double side : {-1.0, 1.0}) {
    SurfaceHit s;
    const Ray ray{{{30.5 + 25 * side, 20, 20}}, normalized({{-side, 0.3, 0.4}})};
    ASSERT_TRUE(find_surface(dag, ray, 0.1, s));
    EXPECT_LT(degrees_between(s.normal, {{side, 0, 0}}), 0.1);
    // Rays to the light start on the visible side.
    EXPECT_GT((s.start[0] - 30.5) * side, 0.5);
  }
}

// From far away, where a voxel is as small as a pixel, the normal of stairs is the normal of a
// slope of 45 degrees. From nearby, where a voxel is many pixels wide, it is the normal of a step.
TEST(SurfaceHit, StairsAreASlopeFromAfar) {
  std::set<VoxelScene::Voxel> voxels;
  for (int64_t x = 0; x < 32; ++x)
    for (int64_t z = 0; z < 32; ++z) voxels.insert({x, x, z});
  const VoxelScene scene(5, voxels);
  const DagView dag = scene.view();
  SurfaceHit s;
  const Ray ray{{{16.5, 60, 16.5}}, {{0, -1, 0}}};
  ASSERT_TRUE(find_surface(dag, ray, 0.02, s));
  EXPECT_LT(degrees_between(s.normal, {{-1, 1, 0}}), 2);
  ASSERT_TRUE(find_surface(dag, ray, 1e-4, s));
  EXPECT_LT(degrees_between(s.normal, {{0, 1, 0}}), 0.1);
}

// If there are too few cells to fit a plane, the normal is the normal of the face that the ray
// entered.
TEST(SurfaceHit, ALoneVoxelShowsItsFace) {
  const VoxelScene scene(4, {{7, 7, 7}});
  const DagView dag = scene.view();
  SurfaceHit s;
  ASSERT_TRUE(find_surface(dag, {{{7.5, 20, 7.5}}, {{0, -1, 0}}}, 0.1, s));
  EXPECT_LT(degrees_between(s.normal, {{0, 1, 0}}), 0.1);
}

// occupied_box() is exact in a small grid, where it is computed from voxels instead of coarser
// cells.
TEST(Bounds, AreTheOccupiedVoxels) {
  const VoxelScene scene(5, {{3, 9, 30}, {20, 10, 1}, {4, 4, 4}});
  const Box box = occupied_box(scene.view());
  EXPECT_EQ(box.low[0], 3);
  EXPECT_EQ(box.high[0], 21);
  EXPECT_EQ(box.low[1], 4);
  EXPECT_EQ(box.high[1], 11);
  EXPECT_EQ(box.low[2], 1);
  EXPECT_EQ(box.high[2], 31);
  EXPECT_EQ(occupied_cells(scene.view()).centers.size(), 3u);
}

// Each named view except "inside" shows the complete scene, and the scene fills most of the
// picture, even if it is small in its grid.
TEST(Views, OfASmallSceneShowIt) {
  for (const uint32_t grid_levels : {3u, 10u})
    for (const int edge : {1, 4}) {
      const VoxelScene scene(grid_levels, shell({1, 2, 3}, {edge, 1 + edge, 2 + edge}));
      const DagView dag = scene.view();
      for (const std::string& name : view_names()) {
        if (name == "inside") continue;
        constexpr int kPixels = 64;
        const Camera camera(named_view(name, dag, 1, {}), kPixels, kPixels);
        const RayCaster caster(dag);
        int hits = 0, hits_of_border = 0;
        for (int i = 0; i < kPixels * kPixels; ++i) {
          const int x = i % kPixels, y = i / kPixels;
          Hit hit;
          if (!caster.cast(camera.ray(x + 0.5, y + 0.5), {0, 0}, 0, 1e30, hit)) continue;
          ++hits;
          hits_of_border += x == 0 || y == 0 || x == kPixels - 1 || y == kPixels - 1;
        }
        EXPECT_GT(hits, kPixels * kPixels / 4) << name << ", " << grid_levels << ", " << edge;
        EXPECT_EQ(hits_of_border, 0) << name << ", " << grid_levels << ", " << edge;
      }
    }
}

// The view "auto" places the camera outside an object, but inside a furnished room with outer
// walls.
TEST(Views, RoomsAreSeenFromWithin) {
  const VoxelScene object(5, shell({8, 8, 8}, {23, 23, 23}));
  auto voxels = shell({0, 0, 0}, {63, 63, 63});
  for (const auto& v : shell({6, 6, 6}, {57, 57, 57})) voxels.insert(v);
  for (const auto& v : shell({20, 7, 20}, {40, 18, 40})) voxels.insert(v);
  for (const auto& v : shell({10, 7, 10}, {14, 48, 14})) voxels.insert(v);
  const VoxelScene room(6, voxels);
  const auto eye_is_within = [](const VoxelScene& scene) {
    const DagView dag = scene.view();
    const Box box = occupied_box(dag);
    const Vec eye = named_view("auto", dag, 1.5, {}).eye;
    bool within = true;
    for (int axis = 0; axis < 3; ++axis)
      within = within && eye[axis] > box.low[axis] && eye[axis] < box.high[axis];
    return within;
  };
  EXPECT_FALSE(eye_is_within(object));
  EXPECT_TRUE(eye_is_within(room));
}

}  // namespace
