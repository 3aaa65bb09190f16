// Solids: the CPU backends fill the same voxels as the oracle, also if the grid is built in parts.
#include <array>

#include "core/geometry/row_crossings.h"
#include "tests/conformance/harness.h"
#include "tests/oracle/solid/rules.h"
#include "tests/oracle/solid/solids.h"

namespace voxdag {
namespace {

class Solids : public Conformance {
 protected:
  void SetUp() override {
    Conformance::SetUp();
    if (!GetParam().name.starts_with("cpu")) GTEST_SKIP() << "only the CPU backend fills solids";
  }
};
VOXDAG_FOR_ALL_BACKENDS(Solids);

constexpr SolidRule kRules[] = {SolidRule::kWinding, SolidRule::kParity};

oracle::SolidRule oracle_rule(SolidRule rule) {
  return rule == SolidRule::kWinding ? oracle::SolidRule::kWinding : oracle::SolidRule::kParity;
}

// Returns the SolidEntry with which a cube is built: the views (core/geometry/solid_rule.h) from
// the points in which the sample rows enter the low faces of the cube, computed from all triangles
// of the scene.
SolidEntry entry_of(const oracle::Triangles& scene, const Cube& cube, uint32_t levels,
                    SolidRule rule) {
  const int64_t edge = cube.edge_voxels(levels);
  SampleRows rows{
      {0, 0, 0}, sample_pitch_log2(levels), static_cast<int>(edge >> solid_block_log2(levels))};
  for (int a = 0; a < 3; ++a) rows.low[a] = cube.position[a] * edge * kUnitsPerVoxel;
  const int stride = rows.blocks + 1;
  SolidEntry entry{rule, {}};
  for (int a = 0; a < 3; ++a) {
    std::vector<int32_t> left(static_cast<size_t>(stride * stride)), total = left;
    for (const FixedTriangle& t : oracle::fixed(scene))
      rows.for_each_crossing(t, a, [&](int i, int j, int64_t block, int sign) {
        const int row = stride * i + j;
        total[static_cast<size_t>(row)] += sign;
        if (block < 0) left[static_cast<size_t>(row)] += sign;
      });
    for (size_t i = 0; i < total.size(); ++i)
      entry.views[a].push_back(view_of(rule, left[i], total[i]));
  }
  return entry;
}

void expect_solid(Backend& backend, const oracle::Triangles& scene, uint32_t levels,
                  SolidRule rule) {
  const oracle::Solid truth = oracle::voxelize_solid(scene, 1 << levels, oracle_rule(rule));
  const SolidEntry entry = entry_of(scene, Cube{}, levels, rule);
  const SubvolumeTask task{levels, Cube{}, 64, &entry};
  const Built built = build(backend, task, scene);
  EXPECT_EQ(built.summary.interior, truth.interior);
  EXPECT_EQ(built.summary.disputed, truth.disputed);
  expect_equals(built, oracle::build_dag(truth.voxels, 64), task);
}

template <class Visit>
void for_each_solid(Visit visit) {
  for (const oracle::SolidKind kind : oracle::kClosedSolids) visit(kind);
  for (const oracle::SolidKind kind : oracle::kOpenSolids) visit(kind);
}

TEST_P(Solids, EqualTheOracle) {
  const auto backend = open();
  for_each_solid([&](oracle::SolidKind kind) {
    for (uint32_t levels = 2; levels <= 6; ++levels)
      for (uint64_t seed = 0; seed < 2; ++seed)
        for (const SolidRule rule : kRules) {
          if (levels == 6 && seed > 0) continue;
          SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R " << (1 << levels)
                                          << ", seed " << seed << ", rule " << (int)rule);
          expect_solid(*backend, oracle::make_solid(kind, seed, 1 << levels), levels, rule);
          if (HasFailure()) return;
        }
  });
}

// The voxels equal the oracle's in random scenes with slivers, degenerate triangles and edges
// through corners.
TEST_P(Solids, EqualTheOracleOnAnyTriangles) {
  const auto backend = open();
  for (const oracle::SceneKind kind : oracle::kAllKinds)
    for (uint32_t levels = 2; levels <= 5; ++levels)
      for (const SolidRule rule : kRules) {
        SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", R " << (1 << levels)
                                        << ", rule " << (int)rule);
        const oracle::Region grid = oracle::region_of(Cube{}, levels);
        expect_solid(*backend, oracle::make_scene(kind, levels, grid, 30), levels, rule);
        if (HasFailure()) return;
      }
}

// The voxels equal the oracle's in a grid of several tiles that is built as one subvolume.
TEST_P(Solids, EqualTheOracleInSeveralTiles) {
  const auto backend = open();
  for (const oracle::SolidKind kind :
       {oracle::SolidKind::kTorus, oracle::SolidKind::kHalfInverted, oracle::SolidKind::kHoles,
        oracle::SolidKind::kSoup, oracle::SolidKind::kCrossing}) {
    SCOPED_TRACE(oracle::kind_name(kind));
    expect_solid(*backend, oracle::make_solid(kind, 7, 128), 7, SolidRule::kWinding);
  }
}

// The voxels equal the oracle's if the views of corners on the same side of a plane differ. Each
// wall is one triangle, so the backend finds the nodes of its tiles by their plane. Sheets outside
// the grid add to the views of the rows with y below a limit. The limits are at a border of a cube
// of 32^3 voxels and within a block.
TEST_P(Solids, EqualTheOracleIfViewsDifferAlongAPlane) {
  const auto backend = open();
  constexpr int64_t kLow = -100'001, kHigh = 200'001;
  const oracle::Triangle x_wall{
      {{40 * 256 + 77, kLow, kLow}, {40 * 256 + 77, kHigh, kLow}, {40 * 256 + 77, kLow, kHigh}}};
  const oracle::Triangle z_wall{
      {{kLow, kLow, 90 * 256 + 129}, {kHigh, kLow, 90 * 256 + 129}, {kLow, kHigh, 90 * 256 + 129}}};
  for (const int64_t y_limit : {32 * 256 + 1, 20 * 256 + 77}) {
    oracle::Triangles scene;
    for (int64_t sheet = 1; sheet <= 5; ++sheet) {
      const int64_t x = -2049 * sheet - (sheet + 1) % 2;
      scene.push_back({{{x, kLow, kLow}, {x, y_limit, kLow}, {x, y_limit, kHigh}}});
      scene.push_back({{{x, kLow, kLow}, {x, y_limit, kHigh}, {x, kLow, kHigh}}});
    }
    scene.push_back(x_wall);
    expect_solid(*backend, scene, 7, SolidRule::kWinding);
    scene.push_back(z_wall);
    for (const SolidRule rule : kRules) expect_solid(*backend, scene, 7, rule);
  }
}

// Adds a box whose faces point outward.
void add_box(oracle::Triangles& out, const std::array<int64_t, 3>& low, int64_t edge) {
  const auto corner = [&](int c) {
    oracle::Point p{};
    for (int a = 0; a < 3; ++a) p[a] = low[a] + (c >> a & 1) * edge;
    return p;
  };
  constexpr int kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& f : kFaces) {
    out.push_back({corner(f[0]), corner(f[1]), corner(f[2])});
    out.push_back({corner(f[0]), corner(f[2]), corner(f[3])});
  }
}

// The voxels equal the oracle's if several faces are in one plane and overlap. Faces of the boxes
// cover cubes, so that the backend can find the cubes' nodes by their plane.
TEST_P(Solids, EqualTheOracleWithCoplanarFaces) {
  const auto backend = open();
  constexpr int64_t kEdge = 60 * 256, kLow = 5 * 256 + 77;
  using Lows = std::vector<std::array<int64_t, 3>>;
  for (const Lows& lows : {Lows{{kLow, kLow, kLow}, {kLow, kLow, kLow}},
                           Lows{{kLow, kLow, kLow}, {kLow + kEdge, kLow + 4000, kLow + 2048}},
                           Lows{{kLow, kLow, kLow}, {kLow, kLow + 9000, kLow}, {kLow, 777, kLow}}})
    for (const SolidRule rule : kRules) {
      SCOPED_TRACE(testing::Message()
                   << lows.size() << " boxes, the second one at " << lows[1][0] << ' ' << lows[1][1]
                   << ' ' << lows[1][2] << ", rule " << (int)rule);
      oracle::Triangles scene;
      for (const auto& low : lows) add_box(scene, low, kEdge);
      expect_solid(*backend, scene, 7, rule);
    }
}

// The voxels equal the oracle's if very many components (6-connected sets of empty voxels in a
// block) contain no voxel at a corner of their block. The backend collects such components, and
// here it must decide them in several batches. Some of them are in the same block.
TEST_P(Solids, EqualTheOracleWithManyComponents) {
  const auto backend = open();
  oracle::Triangles scene;
  for (int64_t x = 0; x < 8; ++x)
    for (int64_t y = 0; y < 8; ++y)
      for (int64_t z = 0; z < 8; ++z)
        add_box(scene, {1024 * x + 129, 1024 * y + 129, 1024 * z + 129}, 512);
  for (const SolidRule rule : kRules) expect_solid(*backend, scene, 5, rule);
}

// The octants of a grid, each as its own subvolume, set the same voxels as the whole grid.
TEST_P(Solids, EqualTheirParts) {
  const auto backend = open();
  for_each_solid([&](oracle::SolidKind kind) {
    for (const SolidRule rule : kRules) {
      SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", rule " << (int)rule);
      const oracle::Triangles scene = oracle::make_solid(kind, 3, 128);
      const SolidEntry whole_entry = entry_of(scene, Cube{}, 7, rule);
      const Built whole = build(*backend, {7, Cube{}, 64, &whole_entry}, scene);
      uint64_t voxels = 0, interior = 0, disputed = 0;
      for (int c = 0; c < 8; ++c) {
        const Cube part = Cube{}.child(c);
        const SolidEntry entry = entry_of(scene, part, 7, rule);
        const SubvolumeTask task{7, part, 64, &entry};
        const Built built = build(*backend, task, scene);
        voxels += built.summary.voxels;
        interior += built.summary.interior;
        disputed += built.summary.disputed;
        const oracle::Region region = oracle::region_of(part, 7);
        EXPECT_TRUE(voxels_of(built.dag, part, 7, region) ==
                    voxels_of(whole.dag, Cube{}, 7, region));
      }
      EXPECT_EQ(voxels, whole.summary.voxels);
      EXPECT_EQ(interior, whole.summary.interior);
      EXPECT_EQ(disputed, whole.summary.disputed);
    }
  });
}

}  // namespace
}  // namespace voxdag
