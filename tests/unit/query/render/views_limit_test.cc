// The time to compute named views is limited for any scene, and the computation can be canceled.
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "query/rays/ray_caster.h"
#include "query/render/views.h"
#include "tests/support/error_of.h"
#include "tests/unit/query/voxel_scene.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

// A grid of 2^16 voxels per edge with one small cluster of voxels in each of 256^3 cells: nodes
// with all children, then nodes with one child. Rays pass through hundreds of cells and rarely hit
// a cluster.
VoxelScene dust() {
  VoxelScene scene = VoxelScene::wall(16, 0);
  for (uint32_t level = 0; level < 14; ++level) {
    const uint32_t mask = level < 8 ? 0xffu : 1u << (5 * level % 8);
    scene.level_words(level).assign(9, 0);
    scene.level_words(level)[0] = mask;
  }
  return scene;
}

TEST(RayCaster, StopsAfterItsSteps) {
  const VoxelScene scene = dust();
  const DagView dag = scene.view();
  const RayCaster caster(dag);
  const double edge = static_cast<double>(dag.resolution());
  const Ray ray{{{-1, 0.3 * edge, 0.4 * edge}}, normalized({{1, 0.01, 0.003}})};
  Hit hit, limited_hit;
  const bool is_hit = caster.cast(ray, {}, 0, 4 * edge, hit);
  uint64_t left = 1 << 20;
  EXPECT_EQ(caster.cast(ray, {}, 0, 4 * edge, limited_hit, left), is_hit);
  EXPECT_EQ(limited_hit.t, hit.t);
  const uint64_t needed = (1 << 20) - left;
  ASSERT_GT(needed, 100u);
  ASSERT_LT(needed, 100000u);
  left = needed + 1;
  EXPECT_EQ(caster.cast(ray, {}, 0, 4 * edge, limited_hit, left), is_hit);
  EXPECT_EQ(left, 1u);
  left = needed / 2;
  EXPECT_FALSE(caster.cast(ray, {}, 0, 4 * edge, limited_hit, left));
  EXPECT_EQ(left, 0u);
  EXPECT_FALSE(caster.cast(ray, {}, 0, 4 * edge, limited_hit, left));
}

// Without a limit, this view would take minutes. With the limit, it takes seconds, and its camera
// is still inside the grid.
TEST(Views, OfDustTakeAFewSeconds) {
  const VoxelScene scene = dust();
  const DagView dag = scene.view();
  const double start_s = thread_cpu_seconds();
  const Placement inside = named_view("inside", dag, 1.5, {});
  EXPECT_LT(thread_cpu_seconds() - start_s, 30);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(inside.eye[axis], 0);
    EXPECT_LT(inside.eye[axis], static_cast<double>(dag.resolution()));
  }
}

TEST(Views, CanBeStopped) {
  const VoxelScene scene = dust();
  const DagView dag = scene.view();
  CancelToken cancel;
  std::jthread canceler([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    cancel.cancel();
  });
  EXPECT_EQ(error_of([&] { named_view("inside", dag, 1.5, {}, cancel); }).code(),
            ErrorCode::kCanceled);
  // Computing this box requires visiting a million cells.
  EXPECT_EQ(error_of([&] { occupied_box(VoxelScene::wall(12, 2047).view(), cancel); }).code(),
            ErrorCode::kCanceled);
}

// NamedViews, which computes shared data only once, returns the same camera placements as separate
// calls of named_view().
TEST(Views, AreTheSameTogether) {
  const VoxelScene scene(6, {{4, 4, 4}, {9, 58, 7}, {44, 12, 50}, {60, 1, 3}});
  const DagView dag = scene.view();
  const CancelToken never;
  NamedViews views(dag, never);
  for (const std::string& name : view_names()) {
    const Placement together = views.find(name, 1.5, {}), alone = named_view(name, dag, 1.5, {});
    EXPECT_EQ(length(together.eye - alone.eye), 0) << name;
    EXPECT_EQ(length(together.target - alone.target), 0) << name;
  }
  const Box box = occupied_box(dag);
  EXPECT_EQ(length(views.box().low - box.low), 0);
  EXPECT_EQ(length(views.box().high - box.high), 0);
}

}  // namespace
