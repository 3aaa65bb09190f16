// Builds enclosed solids with a radius: gaps of up to this many voxels are sealed.
#include <array>

#include "core/base/error.h"
#include "scheduler/plan_build.h"
#include "tests/oracle/solid/solids.h"
#include "tests/oracle/solid/walks.h"
#include "tests/oracle/voxels.h"
#include "tests/reference/reference_build.h"
#include "tests/support/error_of.h"

namespace reference {
namespace {

using voxdag::BuildReport;
using voxdag::BuildSpec;
using voxdag::SolidName;

class Radius : public Reference {
 protected:
  BuildSpec sealed(const Triangles& scene, int resolution, int radius) {
    BuildSpec spec = spec_for(scene, resolution);
    spec.geometry.solid = SolidName::kEnclosed;
    spec.geometry.radius = static_cast<uint32_t>(radius);
    return spec;
  }
  void plan(const BuildSpec& spec) {
    voxdag::NoProgress progress;
    const voxdag::CancelToken never;
    voxdag::plan_build(spec, {voxdag::system_files(), progress, never});
  }
  // Builds the solid and compares it with the oracle's.
  void expect_sealed(oracle::SolidKind kind, int edge, int radius) {
    SCOPED_TRACE(testing::Message()
                 << oracle::kind_name(kind) << ", R " << edge << ", radius " << radius);
    const Triangles scene = oracle::make_solid(kind, 5, edge);
    const oracle::Voxels shell = oracle::voxelize(scene, {{0, 0, 0}, edge});
    const oracle::Voxels truth = oracle::enclose(shell, radius);
    const BuildReport report = run(sealed(scene, edge, radius));
    expect_file_equals(report.output, truth, 64);
    ASSERT_TRUE(report.solid);
    EXPECT_EQ(report.solid->radius, static_cast<uint32_t>(radius));
    EXPECT_EQ(report.solid->interior, truth.count() - shell.count());
    EXPECT_EQ(report.warnings.empty(), report.solid->interior > 0);
  }
  std::string refusal_of(uint64_t resolution, uint32_t radius,
                         SolidName solid = SolidName::kEnclosed) {
    BuildSpec spec = sealed(oracle::make_solid(oracle::SolidKind::kBox, 1, 8), 8, 1);
    spec.geometry.resolution = resolution;
    spec.geometry.radius = radius;
    spec.geometry.solid = solid;
    const voxdag::Error error = voxdag::error_of([&] { run(spec); });
    EXPECT_EQ(error.code(), voxdag::ErrorCode::kInvalidInput);
    return error.message();
  }
};

TEST_F(Radius, EqualsTheOracle) {
  for (const auto kind :
       {oracle::SolidKind::kOpenBox, oracle::SolidKind::kHoles, oracle::SolidKind::kSoup,
        oracle::SolidKind::kNested, oracle::SolidKind::kCrossing})
    for (const auto& [edge, radius] : {std::pair(4, 1), {4, 3}, {8, 7}, {16, 1}, {16, 4}})
      expect_sealed(kind, edge, radius);
}

// With these radii, the smallest cubes that core/dag/space/cube_walk.h processes have 4, 8 and 16
// voxels per edge.
TEST_F(Radius, LargeRadius) {
  for (const int radius : {3, 5, 16}) expect_sealed(oracle::SolidKind::kHoles, 32, radius);
}

// A build with one subvolume gives the same bytes as a build with many subvolumes, with any memory
// and any number of threads.
TEST_F(Radius, RunOptionsNeverShow) {
  for (const auto& [kind, radius] :
       {std::pair(oracle::SolidKind::kHoles, 1), std::pair(oracle::SolidKind::kTetrahedra, 6)}) {
    SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", radius " << radius);
    BuildSpec spec = sealed(oracle::make_solid(kind, 6, 256), 256, radius);
    spec.run.subvolume_edge = 256;
    const BuildReport whole = run(spec);
    EXPECT_GT(whole.solid->interior, 0u);
    for (const uint64_t edge : {64, 128}) {
      SCOPED_TRACE(testing::Message() << "subvolumes of " << edge);
      spec.run.subvolume_edge = edge;
      spec.run.threads = edge == 64 ? 2 : 1;
      spec.run.memory_bytes = (edge == 64 ? 64 : 1024) * kMebibyte;
      EXPECT_EQ(run(spec).sha256, whole.sha256);
    }
  }
}

// If the positions of the walking cube in a subvolume do not fit in a thread's share of the memory,
// the build processes the octants of the subvolume one by one. The bytes are the same.
TEST_F(Radius, OctantsNeverShow) {
  BuildSpec spec =
      sealed(oracle::make_scene(oracle::SceneKind::kSpanning, 3, {{0, 0, 0}, 256}, 100), 256, 1);
  spec.run.subvolume_edge = 256;
  spec.run.threads = 1;
  spec.run.memory_bytes = 1024 * kMebibyte;
  const BuildReport whole = run(spec);
  spec.run.threads = 8;
  spec.run.memory_bytes = 64 * kMebibyte;
  const BuildReport divided = run(spec);
  EXPECT_EQ(divided.sha256, whole.sha256);
  EXPECT_EQ(divided.solid->interior, whole.solid->interior);
}

TEST_F(Radius, Refused) {
  EXPECT_NE(refusal_of(64, 17).find("from 0 to 16, not 17"), std::string::npos)
      << refusal_of(64, 17);
  EXPECT_NE(refusal_of(8, 8).find("less than the resolution, 8, not 8"), std::string::npos);
  EXPECT_NE(refusal_of(uint64_t{1} << 20, 1).find("at most 524288"), std::string::npos);
  EXPECT_NE(refusal_of(64, 1, SolidName::kWinding).find("to be enclosed"), std::string::npos);
}

// With a seed, the walk of an empty cube starts around the seed (tests/oracle/solid/walks.h). The
// solid has the voxels that are in no empty cube, and the voxels that are only in cubes of this
// walk.
TEST_F(Radius, SeedsEqualTheOracle) {
  int enclosed = 0, reached = 0, refused = 0;
  for (const auto kind : {oracle::SolidKind::kNested, oracle::SolidKind::kHoles,
                          oracle::SolidKind::kOpenBox, oracle::SolidKind::kTetrahedra})
    for (const auto& [edge, radius] : {std::pair(16, 1), {16, 2}, {32, 3}})
      for (int i = 0; i < 3; ++i) {
        const std::array<int, 3> seed{edge / 2 - i * edge / 6, edge / 2, edge / 2 - i};
        SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R " << edge << ", radius "
                                        << radius << ", seed " << i);
        const Triangles scene = oracle::make_solid(kind, 5, edge);
        const oracle::Voxels shell = oracle::voxelize(scene, {{0, 0, 0}, edge});
        const auto truth = oracle::enclose_seed(shell, radius, seed);
        BuildSpec spec = sealed(scene, edge, radius);
        spec.geometry.seed = {seed[0] + 0.5, seed[1] + 0.5, seed[2] + 0.5};
        if (!truth) {
          ++refused;
          const voxdag::Error error = voxdag::error_of([&] { run(spec); });
          EXPECT_EQ(error.code(), voxdag::ErrorCode::kInvalidInput);
          EXPECT_NE(error.message().find("farther from surfaces"), std::string::npos);
          EXPECT_EQ(voxdag::error_of([&] { plan(spec); }).message(), error.message());
          continue;
        }
        plan(spec);
        const BuildReport report = run(spec);
        expect_file_equals(report.output, truth->voxels, 64);
        EXPECT_EQ(report.solid->interior, truth->voxels.count() - shell.count());
        EXPECT_EQ(report.warnings.empty(), truth->is_enclosed);
        ++(truth->is_enclosed ? enclosed : reached);
      }
  EXPECT_GE(enclosed, 3);
  EXPECT_GT(reached, 3);
  EXPECT_GT(refused, 0);
}

// The subvolumes, the threads and the memory do not change the bytes of a solid with a seed.
TEST_F(Radius, RunOptionsNeverShowWithASeed) {
  BuildSpec spec = sealed(oracle::make_solid(oracle::SolidKind::kNested, 6, 128), 128, 3);
  spec.geometry.seed = {64, 64, 64};
  spec.run.subvolume_edge = 128;
  const BuildReport whole = run(spec);
  EXPECT_GT(whole.solid->interior, 0u);
  spec.run.subvolume_edge = 64;
  spec.run.threads = 2;
  spec.run.memory_bytes = 64 * kMebibyte;
  EXPECT_EQ(run(spec).sha256, whole.sha256);
  spec.geometry.radius = 0;
  EXPECT_NE(run(spec).sha256, whole.sha256);
}

}  // namespace
}  // namespace reference
