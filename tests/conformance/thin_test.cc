// The rule kThin: every backend that has the rule builds exactly the oracle's voxels.
#include <algorithm>

#include "tests/conformance/harness.h"
#include "tests/oracle/check_sub_dag.h"
#include "tests/oracle/solid/rules.h"
#include "tests/oracle/solid/solids.h"

namespace voxdag {
namespace {

class Thin : public Conformance {
 protected:
  void SetUp() override {
    Conformance::SetUp();
    if (!IsSkipped() && !traits_of(VoxelRule::kThin).is_parallel && open()->name() != "cpu")
      GTEST_SKIP() << GetParam().name << " does not have the rule";
  }
};
VOXDAG_FOR_ALL_BACKENDS(Thin);

SubvolumeTask thin_task(uint32_t grid_levels, const Cube& cube, uint32_t hash_bits) {
  return {grid_levels, cube, hash_bits, nullptr, VoxelRule::kThin};
}

void expect_thin(Backend& backend, const SubvolumeTask& task, const oracle::Triangles& triangles) {
  const oracle::Region region = oracle::region_of(task.cube, task.grid_levels);
  const oracle::Dag truth =
      oracle::build_dag(oracle::voxelize_thin(triangles, region), static_cast<int>(task.hash_bits));
  expect_equals(build(backend, task, triangles), truth, task);
}

// The voxels of closed and open meshes equal the oracle's, in complete grids of 4 to 32 voxels per
// edge and in their octants.
TEST_P(Thin, MeshesOfAllKinds) {
  const auto backend = open();
  const auto check = [&](oracle::SolidKind kind) {
    for (uint32_t levels = 2; levels <= 5; ++levels) {
      SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", levels " << levels);
      const auto mesh = oracle::make_solid(kind, levels, 1 << levels);
      expect_thin(*backend, thin_task(levels, Cube{}, 64), mesh);
      if (levels > 2) expect_thin(*backend, thin_task(levels, Cube{1, {1, 0, 1}}, 8), mesh);
    }
  };
  for (const oracle::SolidKind kind : oracle::kClosedSolids) check(kind);
  for (const oracle::SolidKind kind : oracle::kOpenSolids) check(kind);
}

// The voxels of triangles of every kind equal the oracle's, in cubes at random positions of grids
// of up to 2^20 voxels per edge.
TEST_P(Thin, TrianglesOfAllKinds) {
  const auto backend = open();
  oracle::Random random(31);
  for (const oracle::SceneKind kind : oracle::kAllKinds)
    for (int i = 0; i < 5; ++i) {
      const uint32_t grid_levels = i % 2 ? 20 : 9;
      const uint32_t cube_levels = static_cast<uint32_t>(random.between(2, 6));
      Cube cube{grid_levels - cube_levels, {}};
      for (uint32_t& p : cube.position)
        p = static_cast<uint32_t>(random.between(0, (int64_t{1} << cube.level) - 1));
      SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R 2^" << grid_levels
                                      << ", edge 2^" << cube_levels << ", round " << i);
      expect_thin(*backend, thin_task(grid_levels, cube, 64),
                  oracle::make_scene(kind, static_cast<uint64_t>(i),
                                     oracle::region_of(cube, grid_levels), 12));
      if (HasFatalFailure() || HasNonfatalFailure()) return;
    }
}

// The voxels of large triangles equal the oracle's. Such triangles cover many tiles, whose nodes
// the CPU backend takes from its cache of planes (core/backend/cpu/memo).
TEST_P(Thin, LargeFlatSurfaces) {
  const auto backend = open();
  oracle::Random random(32);
  for (int i = 0; i < 6; ++i) {
    const int64_t size = 256 * 256, rise = i < 3 ? size / (1 + i) : random.between(1, size);
    const int64_t a = 1 - 2 * random.between(1, 3000), b = size + 1, c = 30000 + 2 * i + 1;
    const oracle::Triangles mesh = {{{{a, a, c}, {b, a, (c + rise) | 1}, {b, b, c}}},
                                    {{{a, a, c}, {b, b, c}, {a, b, (c - rise / 2) | 1}}}};
    SCOPED_TRACE(testing::Message() << "round " << i);
    const Built built = build(*backend, thin_task(8, Cube{}, 64), mesh);
    for (const int64_t low : {0, 96}) {
      const oracle::Region region{{low, low, 0}, 64};
      oracle::Region above = region;
      above.low[2] = std::min<int64_t>(192, ((c + rise * low / 256) / 256 - 32) / 4 * 4);
      EXPECT_TRUE(voxels_of(built.dag, Cube{}, 8, above) == oracle::voxelize_thin(mesh, above));
      EXPECT_TRUE(voxels_of(built.dag, Cube{}, 8, region) == oracle::voxelize_thin(mesh, region));
    }
  }
}

// The triangles are a point, a segment, and a triangle between the rows of voxel centers. They
// touch voxels, but the subvolume is empty.
TEST_P(Thin, SubvolumesMayBeEmpty) {
  const auto backend = open();
  const oracle::Triangles nothing = {
      {{{1001, 1001, 1001}, {1001, 1001, 1001}, {1001, 1001, 1001}}},
      {{{1001, 1001, 1001}, {5001, 9001, 3001}, {1001, 1001, 1001}}},
      {{{257, 257, 257}, {355, 259, 299}, {281, 355, 267}}},
  };
  EXPECT_TRUE(build(*backend, thin_task(8, Cube{}, 64), nothing).summary.empty());
  EXPECT_TRUE(build(*backend, thin_task(6, Cube{}, 64), nothing).summary.empty());
}

// Neither the order of the triangles nor of their vertices matters, nor their orientation.
TEST_P(Thin, OrderAndOrientationDoNotMatter) {
  const auto backend = open();
  auto mesh = oracle::make_solid(oracle::SolidKind::kTies, 9, 64);
  const SubvolumeTask task = thin_task(6, Cube{}, 64);
  const uint64_t hash = build(*backend, task, mesh).summary.root_hash;
  std::reverse(mesh.begin(), mesh.end());
  for (size_t i = 0; i < mesh.size(); ++i)
    std::rotate(mesh[i].begin(), mesh[i].begin() + i % 3, mesh[i].end());
  EXPECT_EQ(build(*backend, task, mesh).summary.root_hash, hash);
  for (oracle::Triangle& t : mesh) std::swap(t[0], t[1]);
  EXPECT_EQ(build(*backend, task, mesh).summary.root_hash, hash);
}

// A grid's voxels are the same however it is divided into subvolumes.
TEST_P(Thin, OctantsEqualTheWholeGrid) {
  const auto backend = open();
  for (const oracle::SolidKind kind : {oracle::SolidKind::kTies, oracle::SolidKind::kSphere}) {
    const auto mesh = oracle::make_solid(kind, 5, 128);
    const uint64_t whole = build(*backend, thin_task(7, Cube{}, 64), mesh).summary.voxels;
    uint64_t parts = 0;
    for (int c = 0; c < 8; ++c)
      parts += build(*backend, thin_task(7, Cube{}.child(c), 64), mesh).summary.voxels;
    EXPECT_EQ(parts, whole);
    EXPECT_GT(whole, 1000u);
  }
}

}  // namespace
}  // namespace voxdag
