// Estimates of builds with --solid and --thin. If the pilots have the resolution of the build, the
// estimated numbers of voxels and nodes are the build's numbers.
#include "core/fields/field.h"
#include "scheduler/plan_build.h"
#include "scheduler/stages/plan/estimate.h"
#include "tests/oracle/solid/solids.h"
#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using voxdag::BuildReport;
using voxdag::BuildSpec;
using voxdag::Estimate;
using voxdag::SolidName;

constexpr SolidName kPlannedRules[] = {SolidName::kNone, SolidName::kWinding, SolidName::kParity,
                                       SolidName::kEnclosed};

struct LastInputWarning : voxdag::NoProgress {
  void warn_of_input(const voxdag::Warning& warning) override { last = warning; }
  voxdag::Warning last;
};

class SolidPlans : public Reference {
 protected:
  Estimate plan(BuildSpec spec) {
    spec.run.memory_bytes = 256 * kMebibyte;
    warned_ = {};
    return voxdag::plan_build(spec, {voxdag::system_files(), warned_, never_});
  }
  void expect_exact(const BuildSpec& spec) {
    const BuildReport report = run(spec);
    const Estimate estimate = plan(spec);
    EXPECT_EQ(estimate.voxels.likely, static_cast<double>(report.merge.voxels));
    EXPECT_EQ(estimate.svo_nodes.likely, static_cast<double>(report.merge.svo_nodes));
    EXPECT_EQ(estimate.dag_nodes.likely, static_cast<double>(report.merge.dag_nodes));
    ASSERT_EQ(estimate.solid.has_value(), report.solid.has_value());
    if (!report.solid) return;
    EXPECT_EQ(estimate.solid->rule, report.solid->rule);
    EXPECT_EQ(estimate.solid->interior.likely, static_cast<double>(report.solid->interior));
    EXPECT_EQ(estimate.solid->disputed.likely, static_cast<double>(report.solid->disputed));
    EXPECT_EQ(estimate.solid->rows.rows, report.solid->rows);
    EXPECT_EQ(estimate.solid->rows.open, report.solid->open_rows);
    EXPECT_EQ(estimate.solid->rows.odd, report.solid->odd_rows);
    EXPECT_EQ(warned_.last.code, report.warnings.empty() ? "" : report.warnings.front().code);
  }

  LastInputWarning warned_;
  voxdag::CancelToken never_;
};

// The estimate is exact even if equal triangles count twice, as for solids by winding, and if
// triangles extend beyond the grid.
TEST_F(SolidPlans, PilotsEqualTheBuild) {
  for (const auto kind :
       {oracle::SolidKind::kNested, oracle::SolidKind::kHoles, oracle::SolidKind::kDoubled,
        oracle::SolidKind::kCanceled, oracle::SolidKind::kCrossing, oracle::SolidKind::kPlane})
    for (const SolidName rule : kPlannedRules)
      for (const int resolution : {4, 128}) {
        SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R " << resolution << ", "
                                        << voxdag::name_of(rule));
        BuildSpec spec = spec_for(oracle::make_solid(kind, 7, resolution), resolution);
        spec.geometry.solid = rule;
        spec.geometry.thin = rule == SolidName::kNone;
        expect_exact(spec);
      }
}

// A pilot at half the resolution of the build predicts the number of voxels in a box within 2 %.
TEST_F(SolidPlans, InteriorGrowsWithTheVolume) {
  BuildSpec spec = spec_for(oracle::make_solid(oracle::SolidKind::kBox, 7, 4096), 4096);
  spec.geometry.solid = SolidName::kEnclosed;
  const Estimate estimate = plan(spec);
  EXPECT_EQ(estimate.pilot_resolution, 2048u);
  const BuildReport report = run(spec);
  const auto interior = static_cast<double>(report.solid->interior);
  EXPECT_GT(interior, 0.8 * 4096 * 4096);
  EXPECT_NEAR(estimate.solid->interior.likely / interior, 1, 0.02);
  EXPECT_NEAR(estimate.voxels.likely / static_cast<double>(report.merge.voxels), 1, 0.02);
}

}  // namespace
}  // namespace reference
