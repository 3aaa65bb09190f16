#include "scheduler/stages/plan/subvolume_costs.h"

#include <gtest/gtest.h>

#include "scheduler/plan_build.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag {
namespace {

struct MeasuredBuild {
  const char* scene;
  double subvolumes, octree_nodes, dag_nodes, artifact_nodes;
  double bytes;  // peak disk space without the file
};

// The estimates enclose the measured sizes of builds at 4096^3 with the edges 128 and 64.
TEST(SubvolumeCosts, EncloseMeasuredBuilds) {
  constexpr MeasuredBuild kBuilds[] = {
      {"sponza", 5441, 12800213, 502482, 1170207, 17218564},
      {"sponza", 24587, 12800213, 502482, 1519855, 33296170},
      {"dragon", 2456, 3590740, 826455, 2100453, 24490129},
      {"dragon", 10231, 3590740, 826455, 2424877, 32933395},
      {"terrain", 29613, 12379203, 45411, 655481, 27949391},
  };
  for (const MeasuredBuild& build : kBuilds) {
    SCOPED_TRACE(testing::Message() << build.scene << ", " << build.subvolumes);
    const SubvolumeCosts costs =
        estimate_subvolumes(build.subvolumes, build.octree_nodes, exactly(build.dag_nodes));
    EXPECT_LE(costs.artifact_nodes.low, build.artifact_nodes);
    EXPECT_GE(costs.artifact_nodes.high, build.artifact_nodes);
    EXPECT_LE(costs.artifact_bytes.low, build.bytes);
    EXPECT_GE(costs.artifact_bytes.high, build.bytes);
  }
}

// The estimates of `plan` grow if --subvolume makes the subvolumes smaller, also below the edge of
// the planned subvolumes, which the build splits.
TEST(SubvolumeCosts, GrowWithSmallerSubvolumes) {
  const TemporaryFolder folder;
  const std::string scene = folder.path() + "/scene.glb";
  write_spheres(scene, 20000);
  BuildSpec spec = spheres_build(scene, folder.path() + "/out.vdag");
  NoProgress progress;
  CancelToken cancel;
  const BuildContext context{system_files(), progress, cancel};
  Estimate before;
  for (const uint64_t edge : {512, 128, 64}) {
    SCOPED_TRACE(edge);
    spec.run.subvolume_edge = edge;
    const Estimate estimate = plan_build(spec, context);
    EXPECT_GT(estimate.disk_bytes.likely, 1.05 * before.disk_bytes.likely);
    EXPECT_GT(estimate.memory_bytes.likely, before.memory_bytes.likely);
    spec.run.restart = true;
    const BuildReport report = run_build(spec, context);
    EXPECT_GE(estimate.disk_bytes.high, static_cast<double>(report.artifact_bytes + report.bytes));
    before = estimate;
  }
}

}  // namespace
}  // namespace voxdag
