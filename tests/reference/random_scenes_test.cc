// Builds seeded scenes of every kind with the complete pipeline.
#include <cmath>

#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using RandomScenes = Reference;

// Returns the kinds of scenes whose coordinates floats can store exactly.
std::vector<oracle::SceneKind> exact_kinds() {
  std::vector<oracle::SceneKind> kinds(std::begin(oracle::kAllKinds), std::end(oracle::kAllKinds));
  std::erase(kinds, oracle::SceneKind::kWide);
  return kinds;
}

// Files equal the oracle for scenes of every kind, in grids of 4 to 128 voxels per edge, with one
// or many subvolumes, and with truncated and full hashes.
TEST_F(RandomScenes, EqualTheOracle) {
  for (const oracle::SceneKind kind : exact_kinds())
    for (int levels = 2; levels <= 7; ++levels) {
      const int resolution = 1 << levels;
      const auto seed = static_cast<uint64_t>(levels);
      const Triangles scene = oracle::make_scene(kind, seed, {{0, 0, 0}, resolution}, 3 * levels);
      for (const uint64_t edge : {uint64_t{0}, uint64_t{64}}) {
        auto spec = spec_for(scene, resolution);
        spec.run.subvolume_edge = edge;
        spec.run.threads = edge ? 2 : 1;
        spec.geometry.hash_bits = levels % 3 == 0 ? 4 : levels % 3 == 1 ? 16 : 64;
        SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R " << resolution
                                        << ", subvolumes of " << edge);
        expect_right(scene, resolution, spec);
        if (HasFailure()) return;
      }
    }
}

// The file equals the oracle if the grid is a cube inside the scene. Triangles cross the grid's
// boundary or miss the grid, and some vertices are far outside.
TEST_F(RandomScenes, GivenCubeInsideTheScene) {
  const Triangles scene =
      oracle::make_scene(oracle::SceneKind::kSoup, 5, {{-200, -100, -300}, 512}, 150);
  const Triangles spanning =
      oracle::make_scene(oracle::SceneKind::kSpanning, 5, {{-30000, -30000, -30000}, 60000}, 60);
  Triangles all = scene;
  all.insert(all.end(), spanning.begin(), spanning.end());
  auto spec = spec_for(all, 128);
  spec.run.subvolume_edge = 64;
  const auto report = expect_right(all, 128, spec);
  EXPECT_GT(report.merge.voxels, 0u);
  EXPECT_GT(report.dropped_outside, 0u);
  EXPECT_EQ(report.dropped_outside + report.triangles, all.size());
}

// The scene has arbitrary floats as coordinates, and the build computes the default cube of the
// grid. The oracle, which computes the cube and snaps the vertices with its own code, gives the
// same DAG.
TEST_F(RandomScenes, DefaultCube) {
  oracle::Random random(6);
  for (int round = 0; round < 12; ++round) {
    SCOPED_TRACE(round);
    std::vector<WorldTriangle> world(20);
    const double scale = std::ldexp(1.0, static_cast<int>(random.between(-20, 20)));
    for (WorldTriangle& t : world)
      for (auto& p : t)
        for (double& x : p)
          x = scale * (static_cast<double>(random.between(-1000000, 1000000)) / 7e5 +
                       (round % 3 ? 0 : 1000));
    world = as_floats(world);
    const std::string path = folder_.file("world.glb");
    write_glb(path, world);
    voxdag::BuildSpec spec;
    spec.geometry.scenes = {path};
    spec.geometry.resolution = 64;
    oracle::WorldCube cube = oracle::default_cube(world);
    if (round % 4 == 1) {
      spec.geometry.voxel_size = cube.edge / 40;
      cube = oracle::cube_of_voxel_size(world, cube.edge / 40, 64);
    }
    const auto report = run(spec);
    EXPECT_EQ(report.grid.edge, cube.edge);
    EXPECT_EQ(report.grid.origin, cube.origin);
    const auto voxels = oracle::voxelize(oracle::snap(world, cube, 64), {{0, 0, 0}, 64});
    expect_file_equals(report.output, voxels, 64);
    if (HasFailure()) return;
  }
}

// A scene that is divided between two files gives the same bytes as the scene in one file.
TEST_F(RandomScenes, SeveralFilesAreOneScene) {
  const Triangles scene = oracle::make_scene(oracle::SceneKind::kSoup, 7, {{0, 0, 0}, 64}, 30);
  const auto whole = expect_right(scene, 64, spec_for(scene, 64));
  auto spec = spec_for({scene.begin(), scene.begin() + 7}, 64);
  const auto rest = spec_for({scene.begin() + 7, scene.end()}, 64);
  spec.geometry.scenes.push_back(rest.geometry.scenes[0]);
  EXPECT_EQ(contents(run(spec).output), contents(whole.output));
}

// If no triangle is in the grid, a build with allow_empty writes a valid file without nodes.
TEST_F(RandomScenes, EmptyScenes) {
  const Triangles none, outside = {{{{-999, -999, -999}, {-999, -1, -1}, {-1, -999, -999}}}};
  for (const Triangles& scene : {none, outside}) {
    auto spec = spec_for(scene, 64);
    EXPECT_THROW(run(spec), voxdag::Error);
    spec.run.allow_empty = true;
    const auto report = expect_right(scene, 64, spec);
    EXPECT_EQ(report.merge.dag_nodes, 0u);
    EXPECT_EQ(report.dropped_outside, scene.size());
  }
}

}  // namespace
}  // namespace reference
