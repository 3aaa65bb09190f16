// Builds enclosed solids with a seed: only the empty space around the seed becomes solid. Compares
// the results with a flood fill of the oracle's shell.
#include <set>

#include "core/base/error.h"
#include "scheduler/plan_build.h"
#include "tests/oracle/solid/solids.h"
#include "tests/oracle/voxels.h"
#include "tests/reference/reference_build.h"
#include "tests/support/error_of.h"

namespace reference {
namespace {

using voxdag::BuildReport;
using voxdag::BuildSpec;
using voxdag::SolidName;

using SeedVoxel = std::array<int, 3>;

// Sets the empty voxel `start` and all empty voxels that a path of empty face neighbors connects
// with it. Returns false, and sets nothing, if a path leads out of the grid.
bool fill_from(const SeedVoxel& start, oracle::Voxels& voxels) {
  std::vector<SeedVoxel> reached = {start};
  std::set<SeedVoxel> seen = {start};
  for (size_t i = 0; i < reached.size(); ++i)
    for (int a = 0; a < 3; ++a)
      for (const int step : {-1, 1}) {
        SeedVoxel next = reached[i];
        next[static_cast<size_t>(a)] += step;
        const int at = next[static_cast<size_t>(a)];
        if (at < 0 || at >= voxels.edge()) return false;
        if (!voxels.at(next[0], next[1], next[2]) && seen.insert(next).second)
          reached.push_back(next);
      }
  for (const SeedVoxel& v : reached) voxels.set(v[0], v[1], v[2]);
  return true;
}

class Seeds : public Reference {
 protected:
  // Returns the spec of an enclosed solid whose seed is the center of the voxel `seed`.
  BuildSpec seeded(const Triangles& scene, int resolution, const SeedVoxel& seed) {
    BuildSpec spec = spec_for(scene, resolution);
    spec.geometry.solid = SolidName::kEnclosed;
    spec.geometry.seed = {seed[0] + 0.5, seed[1] + 0.5, seed[2] + 0.5};
    return spec;
  }
  // Returns the message with which both the build and its plan refuse the seed.
  std::string refusal(const BuildSpec& spec) {
    const voxdag::Error error = voxdag::error_of([&] { run(spec); });
    EXPECT_EQ(error.code(), voxdag::ErrorCode::kInvalidInput);
    EXPECT_EQ(voxdag::error_of([&] { plan(spec); }).message(), error.message());
    return error.message();
  }
  void plan(const BuildSpec& spec) {
    voxdag::NoProgress progress;
    const voxdag::CancelToken never;
    voxdag::plan_build(spec, {voxdag::system_files(), progress, never});
  }
};

// The seeds are in a cavity, between two shells, in a corner of the grid, and in voxels of the
// surface, where they are refused.
TEST_F(Seeds, EqualTheOracle) {
  for (const auto kind :
       {oracle::SolidKind::kNested, oracle::SolidKind::kTetrahedra, oracle::SolidKind::kDoubled,
        oracle::SolidKind::kHoles, oracle::SolidKind::kTies})
    for (const int edge : {8, 32}) {
      const Triangles scene = oracle::make_solid(kind, 5, edge);
      const oracle::Voxels shell = oracle::voxelize(scene, {{0, 0, 0}, edge});
      for (int i = 0; i < 4; ++i) {
        const SeedVoxel seed{edge / 2 - i * edge / 9, edge / 2, edge / 2 - i};
        SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R " << edge << ", " << i);
        const BuildSpec spec = seeded(scene, edge, seed);
        if (shell.at(seed[0], seed[1], seed[2])) {
          EXPECT_NE(refusal(spec).find("touches the voxel of this point"), std::string::npos);
          continue;
        }
        oracle::Voxels expected = shell;
        const bool is_enclosed = fill_from(seed, expected);
        plan(spec);
        const BuildReport report = run(spec);
        expect_file_equals(report.output, expected, 64);
        EXPECT_EQ(report.solid->interior, expected.count() - shell.count());
        EXPECT_EQ(report.solid->seed, spec.geometry.seed);
        ASSERT_EQ(report.warnings.empty(), is_enclosed);
        if (!is_enclosed) {
          EXPECT_EQ(report.warnings.front().code, "solid-reached");
        }
      }
    }
}

// The space around the seed is inside one subvolume, or extends over many. The subvolume size, the
// threads and the memory do not change the bytes.
TEST_F(Seeds, RunOptionsNeverShow) {
  const Triangles scene = oracle::make_solid(oracle::SolidKind::kNested, 6, 256);
  const auto build = [&](const SeedVoxel& seed, uint64_t edge, unsigned threads) {
    BuildSpec spec = seeded(scene, 256, seed);
    spec.run.subvolume_edge = edge;
    spec.run.threads = threads;
    spec.run.memory_bytes = (edge == 64 ? 64 : 512) * kMebibyte;
    return run(spec);
  };
  std::set<uint64_t> interiors;
  for (int x = 128; x > 0; x -= 36) {
    const oracle::Voxels shell = oracle::voxelize(scene, {{x, 128, 128}, 1});
    if (shell.at(0, 0, 0)) continue;
    const BuildReport whole = build({x, 128, 128}, 256, 1);
    interiors.insert(whole.solid->interior);
    for (const uint64_t edge : {64, 128}) {
      const BuildReport report = build({x, 128, 128}, edge, 2);
      EXPECT_EQ(report.sha256, whole.sha256);
      EXPECT_EQ(report.solid->interior, whole.solid->interior);
    }
  }
  // The counts for the cavity, for the space between the spheres, and 0 for open space.
  EXPECT_GE(interiors.size(), 3u);
}

TEST_F(Seeds, PointsOutsideTheGridAreRefused) {
  const Triangles scene = oracle::make_solid(oracle::SolidKind::kBox, 5, 32);
  for (const SeedVoxel& seed : {SeedVoxel{-1, 3, 3}, SeedVoxel{3, 32, 3}, SeedVoxel{3, 3, 99}})
    EXPECT_NE(refusal(seeded(scene, 32, seed)).find("outside the grid"), std::string::npos);
  BuildSpec winding = seeded(scene, 32, {3, 3, 3});
  winding.geometry.solid = SolidName::kWinding;
  EXPECT_NE(refusal(winding).find("'seed': expected 'solid' to be enclosed"), std::string::npos);
}

}  // namespace
}  // namespace reference
