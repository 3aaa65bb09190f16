// Builds subvolumes of every level, at any position in grids of up to 2^20 voxels per edge.
#include "tests/conformance/harness.h"
#include "tests/oracle/check_sub_dag.h"

namespace voxdag {
namespace {

using Cubes = Conformance;
VOXDAG_FOR_ALL_BACKENDS(Cubes);

Cube random_cube(oracle::Random& random, uint32_t level) {
  const auto position = [&] {
    return static_cast<uint32_t>(random.between(0, (int64_t{1} << level) - 1));
  };
  return {level, {position(), position(), position()}};
}

// Returns a region of `edge` voxels per edge that is inside the grid and contains the cube.
oracle::Region region_around(const Cube& cube, uint32_t grid_levels, int edge) {
  oracle::Region region = oracle::region_of(cube, grid_levels);
  for (int64_t& low : region.low)
    low = std::clamp<int64_t>(low - edge / 2, 0, (int64_t{1} << grid_levels) - edge);
  region.edge = edge;
  return region;
}

// All cubes of all levels of a small grid, down to single bricks, equal the oracle's. Each build
// gets all triangles of the scene, because triangles that miss the cube must have no effect.
TEST_P(Cubes, EveryCubeOfASmallGrid) {
  constexpr uint32_t kLevels = 5;
  const auto backend = open();
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    const auto scene = oracle::make_scene(kind, 77, {{0, 0, 0}, 1 << kLevels}, 12);
    for (uint32_t level = 0; level <= kLevels - 2; ++level)
      for (uint32_t i = 0; i < 1u << 3 * level; ++i) {
        const uint32_t mask = (1u << level) - 1;
        const Cube cube{level, {i & mask, i >> level & mask, i >> 2 * level}};
        SCOPED_TRACE(testing::Message()
                     << oracle::kind_name(kind) << ", level " << level << ", cube "
                     << cube.position[0] << ' ' << cube.position[1] << ' ' << cube.position[2]);
        expect_right(*backend, {kLevels, cube, 16}, scene);
        if (HasFatalFailure() || HasNonfatalFailure()) return;
      }
  }
}

// Small cubes at random positions in grids of up to 2^20 voxels per edge equal the oracle's.
// Triangles are in the cubes, around them and through them.
TEST_P(Cubes, SmallCubesOfLargeGrids) {
  const auto backend = open();
  oracle::Random random(21);
  for (const oracle::SceneKind kind : oracle::kAllKinds)
    for (int i = 0; i < 24; ++i) {
      const uint32_t grid_levels = i % 2 ? 20 : static_cast<uint32_t>(random.between(10, 20));
      const uint32_t cube_levels = static_cast<uint32_t>(random.between(2, 6));
      const Cube cube = random_cube(random, grid_levels - cube_levels);
      const uint32_t hash_bits = i % 3 ? 64 : 4;
      SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R 2^" << grid_levels
                                      << ", edge 2^" << cube_levels << ", round " << i);
      const uint64_t seed = static_cast<uint64_t>(i);
      auto scene =
          oracle::make_scene(kind, seed, oracle::region_of(cube, grid_levels), i % 4 ? 3 : 20);
      for (const oracle::Triangle& t :
           oracle::make_scene(kind, seed, region_around(cube, grid_levels, 512), 20))
        scene.push_back(t);
      expect_right(*backend, {grid_levels, cube, hash_bits}, scene);
      if (HasFatalFailure() || HasNonfatalFailure()) return;
    }
}

// Large cubes of large grids are too large for the oracle. So the test compares only some of their
// regions voxel by voxel, near triangles and elsewhere.
TEST_P(Cubes, RegionsOfLargeCubes) {
  const auto backend = open();
  oracle::Random random(22);
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    constexpr uint32_t kGridLevels = 20, kCubeLevels = 9;
    const Cube cube = random_cube(random, kGridLevels - kCubeLevels);
    const oracle::Region whole = oracle::region_of(cube, kGridLevels);
    SCOPED_TRACE(oracle::kind_name(kind));
    const auto scene = oracle::make_scene(kind, 5, whole, 12);
    const Built built = build(*backend, {kGridLevels, cube, 64}, scene);
    check_sub_dag(built.dag, {.cube_level = cube.level, .grid_levels = kGridLevels});
    uint64_t compared = 0;
    for (int i = 0; i < 24; ++i) {
      oracle::Region region{whole.low, 32};
      const oracle::Point& near = scene[static_cast<size_t>(i) % scene.size()][0];
      for (int a = 0; a < 3; ++a) {
        const int64_t cell = i < 16 ? (near[a] / oracle::kUnits - whole.low[a]) / 32
                                    : random.between(0, whole.edge / 32 - 1);
        region.low[a] += 32 * std::clamp<int64_t>(cell, 0, whole.edge / 32 - 1);
      }
      const oracle::Voxels truth = oracle::voxelize(scene, region);
      ASSERT_EQ(voxels_of(built.dag, cube, kGridLevels, region), truth) << "region " << i;
      compared += truth.count();
    }
    EXPECT_GT(compared, 0u);
  }
}

// Builds a large cube in one piece, and its eight children. The cube has as many voxels as its
// children together, and one octree node more than they have together.
TEST_P(Cubes, CountsAddUp) {
  const auto backend = open();
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    SCOPED_TRACE(oracle::kind_name(kind));
    const Cube cube{3, {6, 1, 3}};
    const auto scene = oracle::make_scene(kind, 8, oracle::region_of(cube, 11), 20);
    const Built whole = build(*backend, {11, cube, 64}, scene);
    uint64_t voxels = 0, svo_nodes = 1;
    for (int c = 0; c < 8; ++c) {
      const Built part = build(*backend, {11, cube.child(c), 64}, scene);
      voxels += part.summary.voxels;
      svo_nodes += part.summary.svo_nodes;
    }
    EXPECT_GT(voxels, 0u);
    EXPECT_EQ(whole.summary.voxels, voxels);
    EXPECT_EQ(whole.summary.svo_nodes, svo_nodes);
  }
}

// A cube is empty if all triangles miss it, even by one unit.
TEST_P(Cubes, MissedCubesAreEmpty) {
  const auto backend = open();
  const Cube cube{4, {5, 6, 7}};  // 64 voxels per edge in a grid of 1024
  oracle::Random random(23);
  oracle::Triangles scene;
  for (int i = 0; i < 300; ++i) {
    // The triangle is outside the cube along one axis, at least one unit away.
    oracle::Triangle t;
    const int64_t axis = random.between(0, 2), near = random.coin() ? -1 : 64 * 256 + 1;
    for (oracle::Point& p : t)
      for (int a = 0; a < 3; ++a) {
        const int64_t low = cube.position[a] * int64_t{64 * 256};
        p[a] = low + random.odd(-20000, 40000);
        if (a == axis)
          p[a] = low + (near < 0 ? -random.odd(1, 2000) : near + 2 * random.between(0, 999));
      }
    scene.push_back(t);
  }
  const Built built = build(*backend, {10, cube, 64}, scene);
  EXPECT_TRUE(built.summary.empty());
  EXPECT_FALSE(built.sink_called);
}

}  // namespace
}  // namespace voxdag
