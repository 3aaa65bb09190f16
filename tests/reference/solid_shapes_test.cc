// Properties of complete builds of solids and of thin voxels that hold for whole classes of meshes:
// volumes of closed meshes, sheets that enclose nothing, the order of triangles, and the separation
// of the inside from the outside.
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "core/fields/field.h"
#include "tests/oracle/solid/crossing.h"
#include "tests/oracle/solid/solids.h"
#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using oracle::SolidKind;
using voxdag::BuildReport;
using voxdag::BuildSpec;
using voxdag::SolidName;

constexpr SolidName kShapeRules[] = {SolidName::kWinding, SolidName::kParity, SolidName::kEnclosed};

class SolidShapes : public Reference {
 protected:
  BuildReport fill(const Triangles& scene, int resolution, SolidName rule) {
    BuildSpec spec = spec_for(scene, resolution);
    spec.geometry.solid = rule;
    return run(spec);
  }
};

// Returns the volume inside a closed mesh, in voxels. Faces point outward.
double volume_of(const Triangles& mesh) {
  double six_volumes = 0;
  for (const auto& [p, q, r] : mesh)
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      six_volumes += static_cast<double>(p[a]) * static_cast<double>(q[b] * r[c] - q[c] * r[b]);
    }
  return six_volumes / 6 / (256.0 * 256 * 256);
}

// The interior voxels are inside the surface, and the interior and the shell together cover it. So
// the exact volume differs from the number of interior voxels by at most the number of voxels of
// the shell.
TEST_F(SolidShapes, VolumeIsWithinTheShell) {
  for (const SolidKind kind : {SolidKind::kSphere, SolidKind::kTorus, SolidKind::kBox})
    for (const SolidName rule : kShapeRules) {
      SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", " << voxdag::name_of(rule));
      const Triangles mesh = oracle::make_solid(kind, 4, 512);
      const double volume = volume_of(mesh);
      ASSERT_GT(volume, 0.05 * 512 * 512 * 512);
      const BuildReport report = fill(mesh, 512, rule);
      EXPECT_LE(static_cast<double>(report.solid->interior), volume);
      EXPECT_GE(static_cast<double>(report.merge.voxels), volume);
      EXPECT_LT(report.merge.voxels - report.solid->interior, report.solid->interior / 10);
    }
}

// A plane through the grid and three walls that meet in a corner enclose nothing, in grids of one
// and of many subvolumes.
TEST_F(SolidShapes, OpenSheetsFillNothing) {
  for (const SolidKind kind : {SolidKind::kPlane, SolidKind::kThreeWalls})
    for (const SolidName rule : kShapeRules)
      for (const uint64_t subvolume_edge : {64, 256}) {
        SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", " << voxdag::name_of(rule)
                                        << ", subvolumes of " << subvolume_edge);
        BuildSpec spec = spec_for(oracle::make_solid(kind, 2, 256), 256);
        const BuildReport shell = run(spec);
        spec.geometry.solid = rule;
        spec.run.subvolume_edge = subvolume_edge;
        const BuildReport report = run(spec);
        EXPECT_EQ(report.solid->interior, 0u);
        EXPECT_EQ(report.sha256, shell.sha256);
        if (rule != SolidName::kEnclosed) {
          EXPECT_GT(report.solid->open_rows, 1000u);
        }
      }
}

// Reverses the list of triangles, and rotates the corners of each triangle by 0, 1 or 2 positions.
Triangles reordered(Triangles scene) {
  std::reverse(scene.begin(), scene.end());
  for (size_t i = 0; i < scene.size(); ++i)
    std::rotate(scene[i].begin(), scene[i].begin() + i % 3, scene[i].end());
  return scene;
}

// Inverts one of `step` triangles.
Triangles inverted(Triangles scene, size_t step) {
  for (size_t i = 0; i < scene.size(); i += step) std::swap(scene[i][1], scene[i][2]);
  return scene;
}

// Neither the order of the triangles nor the first corner of a triangle affects the bytes.
// Inverting all triangles changes the signs of all winding numbers, and the rules do not depend on
// the sign. Parity and enclosed do not depend on the orientation of single triangles either.
TEST_F(SolidShapes, OrderOfTrianglesNeverShows) {
  for (const SolidKind kind :
       {SolidKind::kSphere, SolidKind::kNested, SolidKind::kTies, SolidKind::kHalfInverted,
        SolidKind::kHoles, SolidKind::kSoup, SolidKind::kCrossing})
    for (const SolidName rule : kShapeRules) {
      SCOPED_TRACE(testing::Message() << oracle::kind_name(kind) << ", " << voxdag::name_of(rule));
      const Triangles scene = oracle::make_solid(kind, 3, 128);
      const BuildReport expected = fill(scene, 128, rule);
      EXPECT_EQ(fill(reordered(scene), 128, rule).sha256, expected.sha256);
      EXPECT_EQ(fill(inverted(reordered(scene), 1), 128, rule).sha256, expected.sha256);
      if (rule != SolidName::kWinding) {
        EXPECT_EQ(fill(inverted(scene, 2), 128, rule).sha256, expected.sha256);
      }
    }
}

// The winding number depends on the orientation of single triangles.
TEST_F(SolidShapes, OrientationOfSingleTrianglesShows) {
  const Triangles sphere = oracle::make_solid(SolidKind::kSphere, 3, 128);
  EXPECT_LT(fill(inverted(sphere, 2), 128, SolidName::kWinding).solid->interior,
            fill(sphere, 128, SolidName::kWinding).solid->interior);
}

// Returns the voxels that are not set in the file and that a walk through common faces reaches from
// outside the grid.
std::vector<std::array<int, 3>> reached_from_outside(const std::string& path, int edge) {
  const voxdag_reader::File file(path);
  oracle::Voxels seen(edge);
  std::vector<std::array<int, 3>> reached;
  const auto reach = [&](int x, int y, int z) {
    if (std::min({x, y, z}) < 0 || std::max({x, y, z}) >= edge) return;
    if (seen.at(x, y, z) || file.voxel(x, y, z)) return;
    seen.set(x, y, z);
    reached.push_back({x, y, z});
  };
  for (int i = 0; i < edge; ++i)
    for (int j = 0; j < edge; ++j)
      for (const int side : {0, edge - 1}) {
        reach(side, i, j);
        reach(i, side, j);
        reach(i, j, side);
      }
  for (size_t i = 0; i < reached.size(); ++i) {
    const auto [x, y, z] = reached[i];
    for (const int step : {-1, 1}) {
      reach(x + step, y, z);
      reach(x, y + step, z);
      reach(x, y, z + step);
    }
  }
  return reached;
}

// Thin voxels of a closed mesh separate the inside from the outside: a walk through common faces
// from outside the grid reaches only voxels whose center has winding number 0.
TEST_F(SolidShapes, ThinVoxelsKeepTheOutsideOut) {
  constexpr int kEdge = 32;
  for (const SolidKind kind : {SolidKind::kBox, SolidKind::kSphere, SolidKind::kTorus,
                               SolidKind::kTetrahedra, SolidKind::kNested, SolidKind::kTies}) {
    SCOPED_TRACE(oracle::kind_name(kind));
    const Triangles mesh = oracle::make_solid(kind, 1, kEdge);
    BuildSpec spec = spec_for(mesh, kEdge);
    spec.geometry.thin = true;
    const BuildReport report = run(spec);
    const auto reached = reached_from_outside(report.output, kEdge);
    EXPECT_GT(reached.size(), 4000u);
    EXPECT_LT(reached.size() + report.merge.voxels, uint64_t{kEdge} * kEdge * kEdge);
    int inside = 0;
    for (const auto& [x, y, z] : reached) {
      const oracle::Point center = {x * 256 + 128, y * 256 + 128, z * 256 + 128};
      inside += oracle::winding_number(mesh, center, 0) != 0;
    }
    EXPECT_EQ(inside, 0);
  }
}

}  // namespace
}  // namespace reference
