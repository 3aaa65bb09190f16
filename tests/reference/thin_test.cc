// Builds with --thin. Run options do not affect the bytes. Neither do duplicate triangles, or the
// orientation and the order of the triangles. The expected counts for downloaded scenes were
// computed by independent code.
#include <algorithm>
#include <filesystem>

#include "tests/oracle/solid/rules.h"
#include "tests/oracle/solid/solids.h"
#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using voxdag::BuildReport;
using voxdag::BuildSpec;

class ThinBuilds : public Reference {
 protected:
  BuildSpec thin_spec(const Triangles& scene, int64_t resolution, int copies = 1) {
    BuildSpec spec = spec_for(scene, resolution, copies);
    spec.geometry.thin = true;
    return spec;
  }
};

Triangles meshes_in(int resolution) {
  Triangles scene;
  for (const oracle::SolidKind kind :
       {oracle::SolidKind::kTorus, oracle::SolidKind::kTies, oracle::SolidKind::kPlane,
        oracle::SolidKind::kWithRest, oracle::SolidKind::kSoup})
    for (const auto& t : oracle::make_solid(kind, 3, resolution)) scene.push_back(t);
  return scene;
}

TEST_F(ThinBuilds, EqualTheOracle) {
  for (const int resolution : {4, 32, 128}) {
    SCOPED_TRACE(resolution);
    const Triangles scene = meshes_in(resolution);
    const BuildReport report = run(thin_spec(scene, resolution));
    expect_file_equals(report.output, oracle::voxelize_thin(scene, {{0, 0, 0}, resolution}), 64);
    EXPECT_EQ(report.rule, voxdag::VoxelRule::kThin);
  }
}

TEST_F(ThinBuilds, RunOptionsNeverShow) {
  Triangles scene = meshes_in(256);
  const BuildReport whole = run(thin_spec(scene, 256));
  const auto expect_same = [&](BuildSpec spec) { EXPECT_EQ(run(spec).sha256, whole.sha256); };
  for (const uint64_t edge : {64, 128, 256}) {
    BuildSpec spec = thin_spec(scene, 256);
    spec.run.subvolume_edge = edge;
    spec.run.threads = edge == 64 ? 2 : 1;
    spec.run.memory_bytes = 64 * kMebibyte;
    spec.run.cache_folder = folder_.file("cache");
    expect_same(spec);
    expect_same(spec);  // from the cache
    spec.geometry.thin = false;
    const BuildReport shell = run(spec);
    EXPECT_GT(shell.merge.voxels, whole.merge.voxels);
    EXPECT_EQ(shell.rule, voxdag::VoxelRule::kShell);
  }
  BuildSpec parallel = thin_spec(scene, 256);
  parallel.run.backend = voxdag::BackendName::kParallelHost;
  expect_same(parallel);
  std::reverse(scene.begin(), scene.end());
  for (size_t i = 0; i < scene.size(); ++i) {
    std::rotate(scene[i].begin(), scene[i].begin() + i % 3, scene[i].end());
    if (i % 2) std::swap(scene[i][0], scene[i][1]);
  }
  expect_same(thin_spec(scene, 256, 2));
}

// A build with --thin does not resume the work folder of a build without --thin.
TEST_F(ThinBuilds, AreOtherJobs) {
  const Triangles scene = meshes_in(32);
  BuildSpec spec = spec_for(scene, 32);
  spec.run.work_folder = folder_.file("work");
  spec.run.keep_work = true;
  const BuildReport shell = run(spec);
  spec.geometry.thin = true;
  EXPECT_THROW(run(spec), voxdag::Error);
  spec.run.restart = true;
  EXPECT_LT(run(spec).merge.voxels, shell.merge.voxels);
}

TEST_F(ThinBuilds, RefuseColorsAndCutouts) {
  const Triangles scene = meshes_in(32);
  BuildSpec spec = thin_spec(scene, 32);
  spec.geometry.attributes[voxdag::Attribute::kColor] = true;
  EXPECT_THROW(run(spec), voxdag::Error);
  spec = thin_spec(scene, 32);
  spec.geometry.cutouts = voxdag::CutoutRule::kSkip;
  EXPECT_THROW(run(spec), voxdag::Error);
}

struct SceneCounts {
  const char* name;
  uint64_t voxels, svo_nodes, dag_nodes;
};

TEST_F(ThinBuilds, CountsOfSharedScenes) {
  const SceneCounts scenes[] = {{"bunny_69k.glb", 2112414, 272821, 89760},
                                {"dragon_100k.glb", 1534648, 202244, 79644},
                                {"armadillo.glb", 1451268, 194445, 78212},
                                {"sponza.glb", 9030526, 675812, 54076}};
  for (const SceneCounts& scene : scenes) {
    SCOPED_TRACE(scene.name);
    BuildSpec spec;
    spec.geometry.scenes = {std::string(VOXDAG_SHARED_SCENES) + "/" + scene.name};
    if (!std::filesystem::exists(spec.geometry.scenes[0]))
      GTEST_SKIP() << "the shared scenes are not here: " << spec.geometry.scenes[0];
    spec.geometry.resolution = 1024;
    spec.geometry.thin = true;
    const BuildReport report = run(spec);
    EXPECT_EQ(report.merge.voxels, scene.voxels);
    EXPECT_EQ(report.merge.svo_nodes, scene.svo_nodes);
    EXPECT_EQ(report.merge.dag_nodes, scene.dag_nodes);
  }
}

}  // namespace
}  // namespace reference
