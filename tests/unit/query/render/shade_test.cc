// Tests the colors of surfaces that show a property of the DAG.
#include <gtest/gtest.h>

#include <cmath>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/render/albedo.h"
#include "query/render/renderer.h"
#include "tests/unit/query/query_files.h"
#include "tests/unit/query/voxel_scene.h"

namespace voxdag::query {
namespace {

SurfaceHit shaded_hit(uint32_t depth, int64_t x, int64_t y, int64_t z) {
  SurfaceHit hit;
  hit.depth = depth;
  hit.cell[0] = x;
  hit.cell[1] = y;
  hit.cell[2] = z;
  hit.normal = {{0, 1, 0}};
  return hit;
}
double color_distance(const Vec& a, const Vec& b) { return length(a - b); }

// Seven of the eight bricks of the scene are equal. The brick at the origin has other voxels.
TEST(ShadeColors, SharingShowsHowOftenABrickOccurs) {
  oracle::Voxels voxels(16);
  for (int i = 0; i < 8; ++i) voxels.set(4 * (i >> 2), 4 * (i >> 1 & 1), 4 * (i & 1));
  voxels.set(1, 1, 1);
  const QueryFile scene(voxels);
  const auto file = open_global_file(scene.path());
  const DagView dag(*file);
  const ShadeColors colors(dag, Shade::kSharing);
  const Vec rare = colors.of(shaded_hit(4, 0, 0, 0)), frequent = colors.of(shaded_hit(4, 4, 4, 0));
  EXPECT_EQ(color_distance(frequent, colors.of(shaded_hit(4, 0, 4, 0))), 0) << "the same brick";
  EXPECT_EQ(color_distance(rare, colors.of(shaded_hit(1, 0, 0, 0))), 0)
      << "a node that occurs once";
  EXPECT_GT(frequent[1], rare[1] + 0.3);
  EXPECT_LT(rare[1], 0.05);
}

// The scale is logarithmic: a brick has the color in the middle of the scale if the number of its
// occurrences in the grid is the square root of the largest number.
TEST(ShadeColors, SharingIsLogarithmic) {
  oracle::Voxels voxels(64);
  for (int i = 0; i < 16; ++i) voxels.set(4 * i, 0, 0);
  for (int i = 0; i < 4; ++i) voxels.set(4 * i, 33, 0);
  const QueryFile scene(voxels);
  const auto file = open_global_file(scene.path());
  const DagView dag(*file);
  const Vec middle = ShadeColors(dag, Shade::kSharing).of(shaded_hit(6, 4, 33, 0));
  EXPECT_NEAR(middle[0], linear_of_srgb_value(0.13), 1e-9);
  EXPECT_NEAR(middle[1], linear_of_srgb_value(0.57), 1e-9);
}

TEST(ShadeColors, NeighborLevelsDiffer) {
  const VoxelScene scene = VoxelScene::block();
  const DagView dag = scene.view();
  const ShadeColors colors(dag, Shade::kLevel);
  for (uint32_t level = 0; level < 20; ++level)
    EXPECT_GT(color_distance(colors.of(shaded_hit(level, 0, 0, 0)),
                             colors.of(shaded_hit(level + 1, 0, 0, 0))),
              0.1);
}

// The front of the block has the normal (0, 0, 1). Its color has the bytes (128, 128, 255).
TEST(ShadeColors, NormalsAreNotLit) {
  const VoxelScene scene = VoxelScene::block();
  const DagView dag = scene.view();
  RenderOptions options{.width = 64, .height = 48};
  options.shade = Shade::kNormal;
  NoProgress progress;
  Picture picture = render_picture(dag, kFromTheFront, options, progress, CancelToken{});
  const uint8_t* const pixel = picture.pixel(32, 26);
  EXPECT_NEAR(pixel[0], 128, 12);
  EXPECT_NEAR(pixel[1], 128, 12);
  EXPECT_GT(pixel[2], 245);
}

TEST(ShadeColors, NamesAreChecked) {
  EXPECT_EQ(shade_named("level"), Shade::kLevel);
  EXPECT_THROW(shade_named("blue"), Error);
}

TEST(ShadeColors, ADamagedDagIsReported) {
  VoxelScene scene = VoxelScene::block();
  scene.level_words(1).at(1) = 0x7fffffff;
  const DagView dag = scene.view();
  EXPECT_THROW(ShadeColors(dag, Shade::kSharing), Error);
}

}  // namespace
}  // namespace voxdag::query
