#include "query/render/depth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/unit/query/voxel_scene.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

constexpr int kWidth = 40, kHeight = 30;

DepthMap depth_of(const VoxelScene& scene, unsigned threads) {
  const DagView dag = scene.view();
  return render_depth(dag, kFromTheFront, kWidth, kHeight, threads, CancelToken());
}

// Returns the distance at which the ray through the center of a pixel enters the block, a cube from
// 6 to 10 along each axis. Intersects the ray with the cube's six planes.
double distance_to_block(int x, int y) {
  const double eye[3] = {8, 9, 24}, length = std::sqrt(1 + 16.0 * 16);
  const double tangent = std::tan(20 * std::acos(-1) / 180);
  const double right = (2 * (x + 0.5) / kWidth - 1) * tangent * kWidth / kHeight;
  const double up = (1 - 2 * (y + 0.5) / kHeight) * tangent;
  // The camera looks along (0, -1, -16). The axes of its picture are (1, 0, 0) and (0, 16, -1).
  double d[3] = {right, (-1 + 16 * up) / length, (-16 - up) / length};
  const double norm = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  double enter = 0, leave = 1e9;
  for (int a = 0; a < 3; ++a) {
    const double t0 = (6 - eye[a]) / d[a] * norm, t1 = (10 - eye[a]) / d[a] * norm;
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  }
  return enter < leave ? enter : INFINITY;
}

TEST(Depth, IsTheDistanceAlongTheRay) {
  const DepthMap map = depth_of(VoxelScene::block(), 3);
  int hits = 0;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const double expected = distance_to_block(x, y);
      const float depth = map.depths[static_cast<size_t>(y * kWidth + x)];
      hits += std::isfinite(expected);
      if (std::isfinite(expected))
        EXPECT_NEAR(depth, expected, 1e-4) << x << " " << y;
      else
        EXPECT_EQ(depth, INFINITY) << x << " " << y;
    }
  EXPECT_GT(hits, 50);
  EXPECT_EQ(depth_of(VoxelScene::block(), 1).depths, map.depths);
}

TEST(Depth, OfAnEmptySceneIsInfinite) {
  for (const float depth : depth_of(VoxelScene(4, {}), 1).depths) ASSERT_EQ(depth, INFINITY);
}

// The file has the format of NumPy, version 1.0: a signature, the length of the header text, this
// text, and the numbers.
TEST(Depth, IsAnArrayForNumpy) {
  const DepthMap map{3, 2, {1, 2, 3, 4, 5, INFINITY}};
  const std::string bytes = encode_npy(map);
  EXPECT_EQ(bytes.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
  const size_t text =
      static_cast<unsigned char>(bytes[8]) + 256u * static_cast<unsigned char>(bytes[9]);
  EXPECT_EQ((10 + text) % 64, 0u);
  EXPECT_EQ(bytes.substr(10, 59), "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }");
  EXPECT_EQ(bytes[9 + text], '\n');
  ASSERT_EQ(bytes.size(), 10 + text + 24);
  std::vector<float> depths(6);
  std::memcpy(depths.data(), bytes.data() + 10 + text, 24);
  EXPECT_EQ(depths, map.depths);
}

}  // namespace
