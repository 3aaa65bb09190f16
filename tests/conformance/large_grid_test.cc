// Tests a grid that is too large for the oracle, so the tests compare implementations with
// different inner loops. In such a grid, a build uses all caches (of planes and their directions),
// tables grow, and a subvolume consists of many tiles (the cubes that the CPU backend draws one by
// one).
#include "tests/conformance/harness.h"

namespace voxdag {
namespace {

struct Part {
  oracle::SceneKind kind;
  int triangles;
};
constexpr Part kParts[] = {
    {oracle::SceneKind::kSliver, 3000},  {oracle::SceneKind::kSubVoxel, 3000},
    {oracle::SceneKind::kWalls, 60},     {oracle::SceneKind::kDiagonal, 12},
    {oracle::SceneKind::kSpanning, 12},  {oracle::SceneKind::kCrossing, 12},
    {oracle::SceneKind::kSoup, 60},      {oracle::SceneKind::kThroughCorners, 60},
    {oracle::SceneKind::kCoincident, 20}};

constexpr uint32_t kLevels = 10;

oracle::Triangles mixed_scene(const Cube& cube, uint64_t seed) {
  oracle::Triangles scene;
  for (const Part& part : kParts)
    for (const oracle::Triangle& t :
         oracle::make_scene(part.kind, seed, oracle::region_of(cube, kLevels), part.triangles))
      scene.push_back(t);
  return scene;
}

// All CPU backends that this machine can run, and the parallel pipeline, give the same arrays for
// the complete grid and for a subvolume.
TEST(LargeGrid, TheSameArraysFromAllThatRunHere) {
  const auto parallel = make_parallel_host_backend(Method::kFast);
  for (const Cube& cube : {Cube{}, Cube{1, {1, 0, 1}}}) {
    const uint64_t seed = 7 + cube.level;
    SCOPED_TRACE(testing::Message() << "cube of level " << cube.level << ", seed " << seed);
    const oracle::Triangles scene = mixed_scene(cube, seed);
    const SubvolumeTask task{kLevels, cube, 64};
    const Built truth = build(*parallel, task, scene);
    ASSERT_EQ(truth.outcome, BuildOutcome::kBuilt);
    EXPECT_GT(truth.summary.voxels, 1'000'000u);
    for (const Simd simd : {Simd::kNone, Simd::kAvx2, Simd::kAvx512}) {
      const Built built = build(*make_cpu_backend(simd), task, scene);
      ASSERT_EQ(built.outcome, BuildOutcome::kBuilt);
      EXPECT_EQ(built.summary.voxels, truth.summary.voxels);
      EXPECT_EQ(built.summary.svo_nodes, truth.summary.svo_nodes);
      EXPECT_TRUE(built.dag == truth.dag) << "the arrays differ";
    }
  }
}

}  // namespace
}  // namespace voxdag
