// A backend builds many subvolumes and caches data between them. The cached data must not affect
// results.
#include "tests/conformance/harness.h"

namespace voxdag {
namespace {

using Reuse = Conformance;
VOXDAG_FOR_ALL_BACKENDS(Reuse);

struct Work {
  SubvolumeTask task;
  oracle::Triangles triangles;
  oracle::Dag truth;
};

// Returns tasks with different grids, cubes, hash bits and scenes. Some tasks have the same
// triangles, as the subvolumes of one build can have.
std::vector<Work> make_work() {
  std::vector<Work> all;
  oracle::Random random(41);
  for (uint64_t scene = 0; scene < 24; ++scene) {
    const uint32_t grid_levels = static_cast<uint32_t>(random.between(6, 20));
    const uint32_t cube_levels = static_cast<uint32_t>(random.between(3, 6));
    Cube cube{grid_levels - cube_levels, {}};
    for (uint32_t& p : cube.position)
      p = static_cast<uint32_t>(random.between(0, (int64_t{1} << cube.level) - 1));
    const oracle::Region region = oracle::region_of(cube, grid_levels);
    const auto kind = oracle::kAllKinds[scene % std::size(oracle::kAllKinds)];
    const auto triangles = oracle::make_scene(kind, scene, region, 8);
    const uint32_t hash_bits = scene % 2 ? 64 : 4;
    for (int c = -1; c < 8; c += 3) {
      const Cube part = c < 0 ? cube : cube.child(c);
      const auto voxels = oracle::voxelize(triangles, oracle::region_of(part, grid_levels));
      all.push_back({{grid_levels, part, hash_bits},
                     triangles,
                     oracle::build_dag(voxels, static_cast<int>(hash_bits))});
    }
  }
  return all;
}

// One backend builds many tasks in random order. Some tasks do not fit in the budget. Every result
// equals the result of a new backend and of the oracle.
TEST_P(Reuse, ResultsDoNotDependOnWhatWasBuiltBefore) {
  const auto all = make_work();
  const auto reused = open();
  oracle::Random random(42);
  for (size_t i = 0; i < 2 * all.size(); ++i) {
    const size_t pick =
        static_cast<size_t>(random.between(0, static_cast<int64_t>(all.size()) - 1));
    SCOPED_TRACE(testing::Message() << "build " << i << ", task " << pick);
    const Work& work = all[pick];
    expect_equals(build(*reused, work.task, work.triangles), work.truth, work.task);
    if (i % 8 == 0) expect_equals(build(*open(), work.task, work.triangles), work.truth, work.task);
    if (i % 32 == 0) {
      const SubvolumeTask large{9, {}, 64};
      const auto scene = oracle::make_scene(oracle::SceneKind::kSpanning, i, {{0, 0, 0}, 512}, 80);
      EXPECT_EQ(build(*reused, large, scene, kSmallestBudget).outcome, BuildOutcome::kNeedsSplit);
    }
  }
}

}  // namespace
}  // namespace voxdag
