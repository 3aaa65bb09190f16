#include "query/rays/ray_caster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/base/error.h"
#include "tests/unit/query/voxel_scene.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

constexpr double kFar = 1e30;

Vec toward(const Vec& from, const Vec& to) { return normalized(to - from); }

// A single voxel in a single brick is hit at its position, on the face toward the ray.
TEST(RayCaster, HitsAVoxelOfABrick) {
  const VoxelScene scene(2, {{1, 2, 3}});
  const DagView dag = scene.view();
  const RayCaster caster(dag);
  Hit hit;
  ASSERT_TRUE(caster.cast({{{-5, 2.5, 3.5}}, {{1, 0, 0}}}, {}, 0, kFar, hit));
  EXPECT_DOUBLE_EQ(hit.t, 6);
  EXPECT_EQ(hit.axis, 0);
  EXPECT_EQ(hit.depth, 2u);
  EXPECT_EQ(hit.cell[0], 1);
  EXPECT_EQ(hit.cell[1], 2);
  EXPECT_EQ(hit.cell[2], 3);
  ASSERT_TRUE(caster.cast({{{1.5, 2.5, 9}}, {{0, 0, -1}}}, {}, 0, kFar, hit));
  EXPECT_DOUBLE_EQ(hit.t, 5);
  EXPECT_EQ(hit.axis, 2);
  EXPECT_FALSE(caster.cast({{{-5, 1.5, 3.5}}, {{1, 0, 0}}}, {}, 0, kFar, hit));
}

// A ray that begins in a voxel hits it immediately. A ray that begins behind the voxel, or whose
// t_max is too small, misses it.
TEST(RayCaster, KeepsToItsInterval) {
  const VoxelScene scene(3, {{4, 4, 4}});
  const DagView dag = scene.view();
  const RayCaster caster(dag);
  Hit hit;
  ASSERT_TRUE(caster.cast({{{4.5, 4.5, 4.5}}, {{1, 0, 0}}}, {}, 0, kFar, hit));
  EXPECT_EQ(hit.t, 0);
  EXPECT_EQ(hit.axis, -1);
  EXPECT_FALSE(caster.cast({{{5.5, 4.5, 4.5}}, {{1, 0, 0}}}, {}, 0, kFar, hit));
  EXPECT_FALSE(caster.cast({{{0.5, 4.5, 4.5}}, {{1, 0, 0}}}, {}, 0, 3, hit));
  EXPECT_TRUE(caster.cast({{{0.5, 4.5, 4.5}}, {{1, 0, 0}}}, {}, 0, 4, hit));
}

TEST(RayCaster, FindsNothingInAnEmptyScene) {
  const VoxelScene scene(4, {});
  const DagView dag = scene.view();
  Hit hit;
  EXPECT_TRUE(dag.empty());
  EXPECT_FALSE(RayCaster(dag).cast({{{-1, 1, 1}}, {{1, 0, 0}}}, {}, 0, kFar, hit));
}

// Returns the parameter at which a ray enters the cube of a voxel; kFar if the ray misses it.
double entry(const Ray& ray, const VoxelScene::Voxel& voxel) {
  double in = 0, out = kFar;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (static_cast<double>(voxel[static_cast<size_t>(axis)]) - ray.origin[axis]) /
                     ray.direction[axis];
    const double b = a + 1 / ray.direction[axis];
    in = std::max(in, std::min(a, b));
    out = std::min(out, std::max(a, b));
  }
  return in <= out ? in : kFar;
}

// For rays from inside and outside the grid, in all directions, the caster finds the same hit as an
// intersection with every voxel.
TEST(RayCaster, AgreesWithTryingEveryVoxel) {
  constexpr uint64_t kSeed = 20240601;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937_64 random(kSeed);
  std::uniform_real_distribution<double> place(-20, 52), spread(-1, 1);
  std::set<VoxelScene::Voxel> voxels;
  while (voxels.size() < 300)
    voxels.insert({static_cast<int64_t>(random() % 32), static_cast<int64_t>(random() % 32),
                   static_cast<int64_t>(random() % 32)});
  const VoxelScene scene(5, voxels);
  const DagView dag = scene.view();
  const RayCaster caster(dag);
  int hits = 0;
  for (int i = 0; i < 10000; ++i) {
    const Vec origin{{place(random), place(random), place(random)}};
    const Ray ray{origin, normalized({{spread(random), spread(random), spread(random)}})};
    double nearest = kFar;
    for (const auto& v : voxels) nearest = std::min(nearest, entry(ray, v));
    Hit hit;
    ASSERT_EQ(caster.cast(ray, {}, 0, kFar, hit), nearest < kFar) << "ray " << i;
    if (nearest == kFar) continue;
    ++hits;
    ASSERT_NEAR(hit.t, nearest, 1e-9) << "ray " << i;
    ASSERT_TRUE(voxels.contains({hit.cell[0], hit.cell[1], hit.cell[2]})) << "ray " << i;
  }
  EXPECT_GT(hits, 300);
}

// In a grid of 131072^3 voxels, no ray passes through a wall that is one voxel thick. The rays come
// from all angles, and also hit edges and corners of cells of all sizes.
TEST(RayCaster, SeesNoCracksAtHighResolution) {
  constexpr uint64_t kSeed = 7;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  constexpr uint32_t kLevels = 17;
  constexpr int64_t kPlane = 77777;
  const double edge = 1 << kLevels;
  const VoxelScene scene = VoxelScene::wall(kLevels, kPlane);
  const DagView dag = scene.view();
  const RayCaster caster(dag);
  std::mt19937_64 random(kSeed);
  std::uniform_real_distribution<double> anywhere(0, 1);
  for (int i = 0; i < 50000; ++i) {
    const bool from_below = i & 1;
    const Vec origin{{from_below ? -anywhere(random) * edge : (1 + anywhere(random)) * edge,
                      anywhere(random) * edge, anywhere(random) * edge}};
    // Half of the rays are aimed at a corner of a cell.
    Vec target{{static_cast<double>(kPlane) + (from_below ? 0 : 1), anywhere(random) * edge,
                anywhere(random) * edge}};
    if (i & 2) {
      const double cell = static_cast<double>(1 << random() % kLevels);
      target[1] = std::floor(target[1] / cell) * cell;
      target[2] = std::floor(target[2] / cell) * cell;
    }
    if (!(target[1] > 1 && target[2] > 1)) continue;
    Hit hit;
    ASSERT_TRUE(caster.cast({origin, toward(origin, target)}, {}, 0, kFar, hit)) << "ray " << i;
    ASSERT_EQ(hit.cell[0], kPlane) << "ray " << i;
    ASSERT_EQ(hit.depth, kLevels);
    ASSERT_NEAR(hit.t, length(target - origin), 1e-5 * edge);
  }
}

// The caster treats a cell that is not wider than the ray's cone as solid. The first number of the
// cone is its width at the origin; the second is its growth per distance.
TEST(RayCaster, EndsAtTheConesWidth) {
  const VoxelScene scene(6, {{63, 63, 63}});
  const DagView dag = scene.view();
  const RayCaster caster(dag);
  const Ray ray{{{40, 56.5, -1000}}, {{0, 0, 1}}};
  Hit hit;
  EXPECT_FALSE(caster.cast(ray, {}, 0, kFar, hit));
  EXPECT_FALSE(caster.cast(ray, {31, 0}, 0, kFar, hit));
  ASSERT_TRUE(caster.cast(ray, {32, 0}, 0, kFar, hit));
  EXPECT_EQ(hit.depth, 1u);
  EXPECT_DOUBLE_EQ(hit.t, 1032);
  ASSERT_TRUE(caster.cast(ray, {0, 0.04}, 0, kFar, hit));
  EXPECT_EQ(hit.depth, 1u);
}

// Rays through a damaged node give an error; no word outside a level is read.
TEST(RayCaster, RefusesOffsetsOutsideALevel) {
  const Ray ray{{{-1, 0.5, 0.5}}, {{1, 0, 0}}};
  const auto code_of = [&](uint32_t level, size_t word, uint32_t value) {
    VoxelScene scene(5, {{20, 0, 0}});
    scene.level_words(level).at(word) = value;
    const DagView dag = scene.view();
    Hit hit;
    try {
      RayCaster(dag).cast(ray, {}, 0, kFar, hit);
    } catch (const Error& error) {
      return error.code();
    }
    return ErrorCode::kIo;
  };
  EXPECT_EQ(code_of(0, 1, 2), ErrorCode::kCorrupt);      // a child beyond the next level
  EXPECT_EQ(code_of(2, 1, 1), ErrorCode::kCorrupt);      // half a brick
  EXPECT_EQ(code_of(1, 0, 0), ErrorCode::kCorrupt);      // a node without children
  EXPECT_EQ(code_of(1, 0, 0x1ff), ErrorCode::kCorrupt);  // nine children
  EXPECT_EQ(code_of(1, 0, 0xff), ErrorCode::kCorrupt);   // children beyond the level's end
  EXPECT_EQ(code_of(2, 1, 0xffffffff), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of(3, 0, 0), ErrorCode::kCorrupt);  // a brick without voxels
}

}  // namespace
