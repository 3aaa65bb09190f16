// Builds of solids on a cluster. Tasks fill solids by winding and parity. The process that merges
// fills an enclosed solid.
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/fields/field.h"
#include "scheduler/run_build.h"
#include "tests/support/error_of.h"
#include "tests/unit/scheduler/slurm/played_slurm.h"

namespace voxdag {
namespace {

BuildSpec with_rule(BuildSpec spec, SolidName rule) {
  spec.geometry.solid = rule;
  return spec;
}

TEST_F(Cluster, EnclosedSolidsHaveTheSameBytes) {
  const BuildReport local = run_build(with_rule(local_spec(), SolidName::kEnclosed), context());
  EXPECT_NE(local.sha256, expected_);
  expected_ = local.sha256;
  for (const uint64_t tasks : {1, 7}) {
    SCOPED_TRACE(tasks);
    const BuildReport report = build(with_rule(spec(tasks), SolidName::kEnclosed));
    EXPECT_EQ(report.cluster->batches, tasks);
    ASSERT_TRUE(report.solid);
    EXPECT_GT(report.solid->interior, 0u);
    EXPECT_EQ(report.solid->interior, local.solid->interior);
  }
}

void expect_same_solid(const BuildReport& report, const BuildReport& local) {
  ASSERT_TRUE(report.solid);
  EXPECT_GT(report.solid->interior, 0u);
  EXPECT_EQ(report.solid->interior, local.solid->interior);
  EXPECT_EQ(report.solid->disputed, local.solid->disputed);
  EXPECT_EQ(report.solid->rows, local.solid->rows);
  EXPECT_EQ(report.solid->open_rows, local.solid->open_rows);
}

TEST_F(Cluster, SolidsByRowsHaveTheSameBytes) {
  for (const SolidName rule : {SolidName::kWinding, SolidName::kParity}) {
    SCOPED_TRACE(name_of(rule));
    const BuildReport local = run_build(with_rule(local_spec(), rule), context());
    expected_ = local.sha256;
    slurm_.fates = {"", "TIMEOUT"};  // a batch is split
    const BuildReport report = build(with_rule(spec(3), rule));
    EXPECT_EQ(report.cluster->batches, 4u);
    expect_same_solid(report, local);
  }
}

// The only subvolume is split after a timeout, and the new tasks split its parts further. Octants
// without triangles are empty or full. With --bounds, triangles outside the grid also count.
TEST_F(Cluster, ASplitSubvolumeOfASolidHasTheSameBytes) {
  const Grid whole = run_build(local_spec(), context()).grid;
  const auto bounded = [&](BuildSpec cut) {
    cut.geometry.bounds = {0, 0, 0, whole.edge / 2};
    for (size_t a = 0; a < 3; ++a) (*cut.geometry.bounds)[a] = whole.origin[a] + 0.3 * whole.edge;
    return with_rule(cut, SolidName::kWinding);
  };
  const BuildReport local = run_build(bounded(local_spec()), context());
  expected_ = local.sha256;
  BuildSpec one = bounded(spec(1));
  one.run.subvolume_edge = 4096;  // one subvolume: the complete grid
  slurm_.fates = {"TIMEOUT"};
  expect_same_solid(build(one), local);
}

// The next run of a failed build reuses the results of the stage `rows` that the failed build has
// saved. A build on this machine can also continue the failed build.
TEST_F(Cluster, AFailedBuildOfASolidGoesOn) {
  const BuildReport local = run_build(with_rule(local_spec(), SolidName::kWinding), context());
  expected_ = local.sha256;
  for (const bool is_local : {false, true}) {
    SCOPED_TRACE(is_local);
    BuildSpec three = with_rule(spec(3), SolidName::kWinding);
    three.run.cluster->max_retries = 0;
    slurm_.fates = {"", "FAILED", ""};
    EXPECT_EQ(error_of([&] { run_build(three, context()); }).code(), ErrorCode::kLimit);
    if (is_local) three.run.cluster.reset();
    const BuildReport report = build(three);
    EXPECT_GT(report.subvolumes_reused, 0u);
    expect_same_solid(report, local);
  }
}

// The process that submits a merge job does not report the solid, because its subvolumes are not
// built yet.
TEST_F(Cluster, TheMergeJobReportsTheSolid) {
  const BuildReport local = run_build(with_rule(local_spec(), SolidName::kWinding), context());
  expected_ = local.sha256;
  CancelToken never;
  Warnings log;
  BuildSpec merging = with_rule(spec(2), SolidName::kWinding);
  slurm_.merge_job = [&] {
    BuildSpec job = merging;
    job.run.cluster->merge_job.reset();
    job.run.cluster->is_merge_job = true;
    run_build(job, {system_files(), log, never});
  };
  merging.run.cluster->merge_job = {.arguments = {"build"}, .folder = "/", .submit_options = {}};
  expect_same_solid(build(merging), local);
  EXPECT_EQ(warnings_.text.find("solid"), std::string::npos) << warnings_.text;
}

}  // namespace
}  // namespace voxdag
