// Builds small grids as one subvolume. All arrays equal the arrays of the oracle's DAG.
#include "tests/conformance/harness.h"

namespace voxdag {
namespace {

using WholeGrid = Conformance;
VOXDAG_FOR_ALL_BACKENDS(WholeGrid);

constexpr uint32_t kHashBits[] = {4, 16, 64};

// The build equals the oracle for scenes of every kind, in grids of 4 to 64 voxels per edge, with
// few and many triangles, and with truncated and full hashes.
TEST_P(WholeGrid, EqualsTheOracle) {
  const auto backend = open();
  for (const oracle::SceneKind kind : oracle::kAllKinds)
    for (uint32_t levels = 2; levels <= 6; ++levels)
      for (uint64_t seed = 0; seed < 6; ++seed) {
        const uint32_t hash_bits = kHashBits[seed % 3];
        SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R " << (1 << levels)
                                        << ", seed " << seed << ", hash bits " << hash_bits);
        const SubvolumeTask task{levels, Cube{}, hash_bits};
        const oracle::Region grid = oracle::region_of(task.cube, levels);
        const int count = seed < 3 ? 1 + static_cast<int>(seed) : 30;
        expect_right(*backend, task, oracle::make_scene(kind, seed, grid, count));
        if (HasFatalFailure() || HasNonfatalFailure()) return;
      }
}

// Like EqualsTheOracle, in a grid of 128 voxels per edge, with all kinds of triangles in one scene.
TEST_P(WholeGrid, EqualsTheOracleOnMixedScenes) {
  const auto backend = open();
  for (const uint32_t hash_bits : {4u, 5u, 33u, 64u}) {
    SCOPED_TRACE(testing::Message() << "hash bits " << hash_bits);
    const SubvolumeTask task{7, Cube{}, hash_bits};
    const oracle::Region grid = oracle::region_of(task.cube, 7);
    oracle::Triangles scene;
    for (const oracle::SceneKind kind : oracle::kAllKinds)
      for (const oracle::Triangle& t : oracle::make_scene(kind, hash_bits, grid, 4))
        scene.push_back(t);
    expect_right(*backend, task, scene);
  }
}

// All 2^18 voxels are set, so the DAG has only one node per level.
TEST_P(WholeGrid, FullGridIsOneNodeALevel) {
  oracle::Triangles scene;
  for (int64_t x = 128 + 1; x < 64 * 256; x += 256) {
    const int64_t end = 64 * 256 - 1;
    scene.push_back({{{x, 1, 1}, {x, end, 1}, {x, end, end}}});
    scene.push_back({{{x, 1, 1}, {x, end, end}, {x, 1, end}}});
  }
  const SubvolumeTask task{6, Cube{}, 64};
  const Built built = build(*open(), task, scene);
  EXPECT_EQ(built.summary.voxels, uint64_t{64 * 64 * 64});
  EXPECT_EQ(built.summary.dag_nodes, 5u);
  EXPECT_EQ(built.summary.svo_nodes, 4096u + 512 + 64 + 8 + 1);
  expect_right(*open(), task, scene);
}

// Without triangles, the sink is not called.
TEST_P(WholeGrid, EmptyScene) {
  const Built built = build(*open(), {10, Cube{}, 64}, oracle::Triangles{});
  EXPECT_EQ(built.outcome, BuildOutcome::kBuilt);
  EXPECT_TRUE(built.summary.empty());
  EXPECT_EQ(built.summary.svo_nodes, 0u);
  EXPECT_EQ(built.summary.dag_nodes, 0u);
  EXPECT_EQ(built.summary.root_hash, 0u);
}

}  // namespace
}  // namespace voxdag
