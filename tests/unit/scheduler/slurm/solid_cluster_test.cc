// Builds of solids on a cluster. An enclosed solid is filled by the merge. Solids by other rules
// are refused, because tasks cannot fill them.
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

TEST_F(Cluster, SolidsByOtherRulesAreRefused) {
  for (const SolidName rule : {SolidName::kWinding, SolidName::kParity}) {
    const Error error = error_of([&] { run_build(with_rule(spec(2), rule), context()); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    for (const char* part : {"solid", name_of(rule), "cluster", "enclosed"})
      EXPECT_NE(error.message().find(part), std::string::npos) << error.message();
  }
  EXPECT_TRUE(slurm_.commands.empty());
}

}  // namespace
}  // namespace voxdag
