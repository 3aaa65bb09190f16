// Complete builds of solids have the voxels of the oracle's solids, and the same bytes for all run
// options.
#include <array>
#include <filesystem>
#include <utility>

#include "tests/oracle/solid/rules.h"
#include "tests/oracle/solid/solids.h"
#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using voxdag::BuildReport;
using voxdag::BuildSpec;
using voxdag::SolidName;

constexpr SolidName kSolids[] = {SolidName::kWinding, SolidName::kParity, SolidName::kEnclosed};

oracle::SolidRule oracle_rule(SolidName name) {
  if (name == SolidName::kEnclosed) return oracle::SolidRule::kEnclosed;
  return name == SolidName::kWinding ? oracle::SolidRule::kWinding : oracle::SolidRule::kParity;
}

std::string name_of_rule(SolidName name) {
  return voxdag::enum_names(name)[static_cast<int>(name)];
}

template <class Visit>
void for_each_solid(Visit visit) {
  for (const oracle::SolidKind kind : oracle::kClosedSolids) visit(kind);
  for (const oracle::SolidKind kind : oracle::kOpenSolids) visit(kind);
}

using SolidBuilds = Reference;

// Builds have the oracle's voxels and counts of the solid. The solid can extend beyond the grid.
// The triangles outside the grid also affect which voxels are inside the solid.
TEST_F(SolidBuilds, EqualTheOracle) {
  for_each_solid([&](oracle::SolidKind kind) {
    for (const int edge : {4, 8, 16, 32})
      for (const SolidName rule : kSolids) {
        SCOPED_TRACE(testing::Message()
                     << oracle::kind_name(kind) << ", R " << edge << ", " << name_of_rule(rule));
        const Triangles scene = oracle::make_solid(kind, 5, edge);
        const oracle::Solid truth = oracle::voxelize_solid(scene, edge, oracle_rule(rule));
        BuildSpec spec = spec_for(scene, edge);
        spec.geometry.solid = rule;
        const BuildReport report = run(spec);
        expect_file_equals(report.output, truth.voxels, 64);
        ASSERT_TRUE(report.solid);
        EXPECT_EQ(report.solid->rule, name_of_rule(rule));
        EXPECT_EQ(report.solid->interior, truth.interior);
        EXPECT_EQ(report.solid->disputed, truth.disputed);
        EXPECT_EQ(report.solid->rows, truth.rows);
        EXPECT_EQ(report.solid->open_rows, truth.open_rows);
        EXPECT_EQ(report.solid->odd_rows, truth.odd_rows);
        EXPECT_DOUBLE_EQ(report.solid->volume, static_cast<double>(truth.voxels.count()));
      }
  });
}

// A grid of 256 voxels per edge is built with one subvolume and with many subvolumes. The bytes and
// the counts of the solid are the same.
TEST_F(SolidBuilds, RunOptionsNeverShow) {
  for_each_solid([&](oracle::SolidKind kind) {
    for (const SolidName rule : kSolids) {
      SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", " << name_of_rule(rule));
      BuildSpec spec = spec_for(oracle::make_solid(kind, 6, 256), 256);
      spec.geometry.solid = rule;
      spec.run.subvolume_edge = 256;
      const BuildReport whole = run(spec);
      for (const uint64_t edge : {0, 64, 128})
        for (const uint64_t memory : {64 * kMebibyte, 1024 * kMebibyte}) {
          SCOPED_TRACE(testing::Message() << "subvolumes of " << edge);
          spec.run.subvolume_edge = edge;
          spec.run.threads = edge == 64 ? 2 : 1;
          spec.run.memory_bytes = memory;
          const BuildReport report = run(spec);
          EXPECT_EQ(report.sha256, whole.sha256);
          EXPECT_EQ(report.solid->interior, whole.solid->interior);
          EXPECT_EQ(report.solid->disputed, whole.solid->disputed);
          EXPECT_EQ(report.solid->rows, whole.solid->rows);
          EXPECT_EQ(report.solid->open_rows, whole.solid->open_rows);
          EXPECT_EQ(report.solid->odd_rows, whole.solid->odd_rows);
        }
    }
  });
}

// Subvolumes that exceed their share of the memory are split. The bytes are the same.
TEST_F(SolidBuilds, SplittingNeverShows) {
  Triangles scene = oracle::make_scene(oracle::SceneKind::kSpanning, 3, {{0, 0, 0}, 1024}, 400);
  for (const auto& t : oracle::make_solid(oracle::SolidKind::kTorus, 1, 1024)) scene.push_back(t);
  BuildSpec spec = spec_for(scene, 1024);
  spec.geometry.solid = SolidName::kWinding;
  spec.run.subvolume_edge = 1024;
  spec.run.memory_bytes = 4096 * kMebibyte;
  const BuildReport whole = run(spec);
  spec.run.memory_bytes = 64 * kMebibyte;
  const BuildReport split = run(spec);
  EXPECT_GT(split.subvolumes_split, 0u);
  EXPECT_EQ(split.sha256, whole.sha256);
  EXPECT_EQ(split.solid->interior, whole.solid->interior);
}

// The stage that fills an enclosed solid works with the artifacts of another backend, and gives the
// same bytes.
TEST_F(SolidBuilds, EnclosedOnOtherBackends) {
  BuildSpec spec = spec_for(oracle::make_solid(oracle::SolidKind::kNested, 1, 256), 256);
  spec.geometry.solid = SolidName::kEnclosed;
  const BuildReport expected = run(spec);
  spec.run.backend = voxdag::BackendName::kParallelHost;
  spec.run.subvolume_edge = 128;
  EXPECT_EQ(run(spec).sha256, expected.sha256);
}

// Returns the twelve triangles of a cube, facing outward. `low` and `high` are in lattice units.
Triangles cube_mesh(int64_t low, int64_t high) {
  const auto corner = [&](int c) -> oracle::Point {
    return {c & 4 ? high : low, c & 2 ? high : low, c & 1 ? high : low};
  };
  Triangles out;
  for (const auto& q : {std::array{0, 1, 3, 2},
                        {4, 6, 7, 5},
                        {0, 4, 5, 1},
                        {2, 3, 7, 6},
                        {0, 2, 6, 4},
                        {1, 5, 7, 3}}) {
    out.push_back({corner(q[0]), corner(q[1]), corner(q[2])});
    out.push_back({corner(q[0]), corner(q[2]), corner(q[3])});
  }
  return out;
}

// If all voxels of the grid are set, the DAG has one node per level, because all nodes of a level
// are equal.
TEST_F(SolidBuilds, BoxFillsTheGrid) {
  BuildSpec spec = spec_for(cube_mesh(1, 512 * 256 - 1), 512);
  for (const SolidName rule : kSolids) {
    spec.geometry.solid = rule;
    const BuildReport report = run(spec);
    EXPECT_EQ(report.merge.voxels, 512u * 512 * 512);
    EXPECT_EQ(report.merge.dag_nodes, 8u);
    EXPECT_EQ(report.warnings.size(), 0u);
  }
}

// All voxels in a large box are set, although its interior has no triangles. The interior contains
// empty octree cubes that are larger than a subvolume, equal to a subvolume, or inside a subvolume.
TEST_F(SolidBuilds, CubesInABoxAreFull) {
  BuildSpec spec = spec_for(cube_mesh(256 * 100 + 1, 256 * 900 - 1), 1024);
  spec.geometry.solid = SolidName::kWinding;
  spec.run.subvolume_edge = 64;
  EXPECT_EQ(run(spec).merge.voxels, 800u * 800 * 800);
}

// The report has a separate warning for each defect of a surface, if this defect affects the rule
// of the solid.
TEST_F(SolidBuilds, Warnings) {
  const auto code = [&](const Triangles& scene, SolidName rule) -> std::string {
    BuildSpec spec = spec_for(scene, 64);
    spec.geometry.solid = rule;
    const BuildReport report = run(spec);
    return report.warnings.empty() ? "" : report.warnings.front().code;
  };
  const Triangles closed = cube_mesh(1001, 15001);
  EXPECT_EQ(code(closed, SolidName::kWinding), "");
  Triangles open = closed;
  open.pop_back();
  EXPECT_EQ(code(open, SolidName::kWinding), "solid-open");
  EXPECT_EQ(code(open, SolidName::kParity), "solid-open");
  EXPECT_EQ(code(closed, SolidName::kEnclosed), "");
  EXPECT_EQ(code(open, SolidName::kEnclosed), "solid-reached");
  Triangles turned = closed;
  std::swap(turned.front()[0], turned.front()[1]);
  EXPECT_EQ(code(turned, SolidName::kWinding), "solid-orientation");
  EXPECT_EQ(code(turned, SolidName::kParity), "");
  Triangles doubled = closed;
  for (oracle::Triangle t : closed) {
    std::swap(t[0], t[1]);
    doubled.push_back(t);
  }
  EXPECT_EQ(code(doubled, SolidName::kWinding), "solid-canceled");
}

// A build of the grid's first octant as its own grid, with the same voxel size, has the same voxels
// as the octant in the complete build.
TEST_F(SolidBuilds, OctantEqualsTheGrid) {
  for (const auto kind : {oracle::SolidKind::kSphere, oracle::SolidKind::kHoles,
                          oracle::SolidKind::kTetrahedra, oracle::SolidKind::kHalfInverted}) {
    SCOPED_TRACE(oracle::kind_name(kind));
    BuildSpec spec = spec_for(oracle::make_solid(kind, 2, 128), 128);
    spec.geometry.solid = SolidName::kWinding;
    const BuildReport whole = run(spec);
    spec.run.allow_empty = true;  // an octant may have no voxels
    spec.geometry.resolution = 64;
    spec.geometry.bounds = {0, 0, 0, 64};
    const BuildReport octant = run(spec);
    const voxdag_reader::File whole_file(whole.output), octant_file(octant.output);
    uint64_t different = 0;
    for (int x = 0; x < 64; ++x)
      for (int y = 0; y < 64; ++y)
        for (int z = 0; z < 64; ++z)
          different += whole_file.voxel(x, y, z) != octant_file.voxel(x, y, z);
    EXPECT_EQ(different, 0u);
  }
}

struct Counts {
  const char* scene;
  uint64_t resolution;
  SolidName rule;
  uint64_t voxels, svo_nodes, dag_nodes;
};
constexpr Counts kCounts[] = {
    {"bunny_69k.glb", 1024, SolidName::kWinding, 216511780, 3985633, 88202},
    {"bunny_69k.glb", 1024, SolidName::kParity, 216420154, 3983930, 88178},
    {"dragon_100k.glb", 1024, SolidName::kWinding, 61089674, 1181211, 76666},
    {"dragon_100k.glb", 1024, SolidName::kParity, 61089674, 1181211, 76666},
    {"armadillo.glb", 1024, SolidName::kWinding, 74982400, 1426126, 75743},
    {"armadillo.glb", 1024, SolidName::kParity, 74982400, 1426126, 75743},
    {"sponza.glb", 1024, SolidName::kWinding, 70380534, 1567526, 46055},
    {"sponza.glb", 1024, SolidName::kParity, 69077971, 1550519, 47634},
    {"dragon_100k.glb", 2048, SolidName::kWinding, 483291363, 8988136, 221447},
    {"bunny_69k.glb", 1024, SolidName::kEnclosed, 3591814, 299473, 110044},
    {"dragon_100k.glb", 1024, SolidName::kEnclosed, 61089742, 1181211, 76642},
    {"armadillo.glb", 1024, SolidName::kEnclosed, 74982400, 1426126, 75743},
    {"sponza.glb", 1024, SolidName::kEnclosed, 16809998, 691344, 48758},
    {"dragon_100k.glb", 2048, SolidName::kEnclosed, 483292733, 8988136, 221276},
};

TEST_F(SolidBuilds, SharedScenes) {
  for (const Counts& row : kCounts) {
    const std::string path = std::string(VOXDAG_SHARED_SCENES) + "/" + row.scene;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "the shared scenes are not here: " << path;
    SCOPED_TRACE(testing::Message()
                 << row.scene << ", R " << row.resolution << ", " << name_of_rule(row.rule));
    BuildSpec spec;
    spec.geometry.scenes = {path};
    spec.geometry.resolution = row.resolution;
    spec.geometry.solid = row.rule;
    spec.run.threads = 2;
    const BuildReport report = run(spec);
    EXPECT_EQ(report.merge.voxels, row.voxels);
    EXPECT_EQ(report.merge.svo_nodes, row.svo_nodes);
    EXPECT_EQ(report.merge.dag_nodes, row.dag_nodes);
  }
}

}  // namespace
}  // namespace reference
