#include "query/render/camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/base/error.h"
#include "query/render/sampling.h"
#include "query/render/views.h"
#include "tests/unit/query/voxel_scene.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

void expect_near(const Vec& a, const Vec& b) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], 1e-12);
}

// Computes the position of a point in the picture, in pixels. It is the inverse of ray(), and is
// written from the definition of the camera.
void project(const Placement& p, const Vec& point, int width, int height, double& x, double& y) {
  const Vec forward = normalized(p.target - p.eye);
  const Vec right = normalized(cross(forward, {{0, 1, 0}})), up = cross(right, forward);
  const Vec d = point - p.eye;
  const double scale = height / 2.0 / std::tan(p.fov_degrees * kPi / 360) / dot(d, forward);
  x = width / 2.0 + dot(d, right) * scale;
  y = height / 2.0 - dot(d, up) * scale;
}

// The ray through the center of the picture points to the target. The angle between this ray and
// the ray through the middle of the upper edge is half the field of view. x increases to the right,
// y downward.
TEST(Camera, RaysFollowTheFieldOfView) {
  const Camera camera({{{0, 0, 10}}, {{0, 0, 0}}, 90}, 200, 100);
  expect_near(camera.ray(100, 50).direction, {{0, 0, -1}});
  expect_near(camera.ray(100, 0).direction, normalized({{0, 1, -1}}));
  expect_near(camera.ray(200, 50).direction, normalized({{2, 0, -1}}));
  EXPECT_NEAR(camera.pixel_spread(), 0.02, 1e-12);
}

// If the camera looks straight down, the picture's up direction is -z by definition.
TEST(Camera, LooksStraightDown) {
  const Camera camera({{{0, 10, 0}}, {{0, 0, 0}}, 90}, 100, 100);
  expect_near(camera.ray(50, 50).direction, {{0, -1, 0}});
  expect_near(camera.ray(50, 0).direction, normalized({{0, -1, -1}}));
  expect_near(camera.ray(100, 50).direction, normalized({{1, -1, 0}}));
}

TEST(Camera, RefusesInvalidPlacements) {
  EXPECT_THROW(Camera({{{1, 2, 3}}, {{1, 2, 3}}, 50}, 10, 10), Error);
  EXPECT_THROW(Camera({{{1, 2, 3}}, {{0, 0, 0}}, 180}, 10, 10), Error);
  EXPECT_THROW(Camera({{{1, 2, 3}}, {{0, 0, 0}}, 0}, 10, 10), Error);
}

// fit_camera() places all points in the picture, centers them, and fills at least 80 % of the
// picture's width or height.
TEST(Camera, FitsThePointsIntoThePicture) {
  std::vector<Vec> points;
  for (int i = 0; i < 8; ++i)
    points.push_back({{i & 4 ? 900.0 : 100, i & 2 ? 250.0 : 200, i & 1 ? 500.0 : 0}});
  constexpr int kWidth = 320, kHeight = 180;
  for (const Vec& toward : {Vec{{0.6, 0.5, 1}}, Vec{{-1, 0.1, 0}}, Vec{{1, 3, 0.2}}}) {
    const Placement p = fit_camera(points, toward, 32, 16.0 / 9);
    double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
    for (const Vec& point : points) {
      double x = 0, y = 0;
      project(p, point, kWidth, kHeight, x, y);
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
    EXPECT_GE(left, 0);
    EXPECT_GE(top, 0);
    EXPECT_LE(right, kWidth);
    EXPECT_LE(bottom, kHeight);
    EXPECT_GT(std::max((right - left) / kWidth, (bottom - top) / kHeight), 0.8);
    EXPECT_NEAR((left + right) / 2, kWidth / 2.0, 0.08 * kWidth);
    EXPECT_NEAR((top + bottom) / 2, kHeight / 2.0, 0.08 * kHeight);
  }
}

// The camera ignores one outlier among thousands of points, so it is not placed farther away. It
// does not ignore the corners of a cube.
TEST(Camera, IgnoresAnOutlier) {
  const auto distance = [](const std::vector<Vec>& points) {
    const Placement p = fit_camera(points, {{1, 0, 0}}, 32, 1);
    return length(p.eye - Vec{{9.5, 9.5, 9.5}});
  };
  std::vector<Vec> points;
  for (int i = 0; i < 20 * 20 * 20; ++i)
    points.push_back({{static_cast<double>(i % 20), static_cast<double>(i / 20 % 20),
                       static_cast<double>(i / 400)}});
  const std::vector<Vec> corners = {points.front(), points.back(), points[19], points[7600]};
  const double without = distance(points);
  EXPECT_NEAR(without, distance(corners), 1e-9);
  points.push_back({{0, 1000, 0}});
  EXPECT_LT(distance(points), 1.2 * without);
}

// The named views look along the axes of their names; the front of a glTF scene is +z.
TEST(Views, LookAlongTheirAxes) {
  const VoxelScene scene(4, {{4, 4, 4}, {9, 8, 7}});
  const DagView dag = scene.view();
  const struct {
    const char* name;
    Vec forward;
  } views[] = {{"front", {{0, 0, -1}}},
               {"back", {{0, 0, 1}}},
               {"left", {{1, 0, 0}}},
               {"right", {{-1, 0, 0}}},
               {"top", {{0, -1, 0}}}};
  for (const auto& view : views) {
    SCOPED_TRACE(view.name);
    const Placement p = named_view(view.name, dag, 1, {});
    expect_near(normalized(p.target - p.eye), view.forward);
  }
  EXPECT_EQ(named_view("front", dag, 1, 70.0).fov_degrees, 70);
  EXPECT_THROW(named_view("below", dag, 1, {}), Error);
}

}  // namespace
