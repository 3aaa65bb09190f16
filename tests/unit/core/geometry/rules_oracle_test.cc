// Tests the oracle for the rules of solids and of thin shells, on meshes whose results are known.
#include <gtest/gtest.h>

#include "tests/oracle/solid/crossing.h"
#include "tests/oracle/solid/rules.h"
#include "tests/oracle/solid/solids.h"

namespace oracle {
namespace {

constexpr SolidRule kRules[] = {SolidRule::kWinding, SolidRule::kParity, SolidRule::kEnclosed};

template <class Visit>
void for_each_voxel(int edge, Visit visit) {
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z) visit(x, y, z);
}

Point center(int x, int y, int z) {
  return {x * kUnits + kUnits / 2, y * kUnits + kUnits / 2, z * kUnits + kUnits / 2};
}

TEST(RulesOracle, WindingOfClosedMeshesIsEachVoxelsOwn) {
  for (const SolidKind kind : kClosedSolids) {
    SCOPED_TRACE(kind_name(kind));
    const Triangles mesh = make_solid(kind, 1, 16);
    const Voxels shell = voxelize(mesh, {{0, 0, 0}, 16});
    const Solid winding = voxelize_solid(mesh, 16, SolidRule::kWinding);
    const Solid parity = voxelize_solid(mesh, 16, SolidRule::kParity);
    for_each_voxel(16, [&](int x, int y, int z) {
      if (shell.at(x, y, z)) return;
      for (int a = 0; a < 3; ++a) {
        const int number = winding_number(mesh, center(x, y, z), a);
        ASSERT_EQ(winding.voxels.at(x, y, z), number != 0);
        ASSERT_EQ(parity.voxels.at(x, y, z), number % 2 != 0);
      }
    });
    EXPECT_EQ(winding.open_rows, 0u);
    EXPECT_EQ(winding.odd_rows, 0u);
    EXPECT_EQ(winding.disputed, 0u);
  }
}

TEST(RulesOracle, OpenSheetsFillNothing) {
  for (const SolidKind kind : {SolidKind::kPlane, SolidKind::kThreeWalls})
    for (const SolidRule rule : kRules)
      EXPECT_EQ(voxelize_solid(make_solid(kind, 2, 32), 32, rule).interior, 0u) << kind_name(kind);
}

TEST(RulesOracle, NestedShellsAreHollowUnlessTheyFaceAlike) {
  const Triangles hollow = make_solid(SolidKind::kNested, 1, 32);
  const Triangles alike = make_solid(SolidKind::kNestedAlike, 1, 32);
  const auto is_filled = [](const Triangles& mesh, SolidRule rule) {
    return voxelize_solid(mesh, 32, rule).voxels.at(16, 16, 16);
  };
  EXPECT_FALSE(is_filled(hollow, SolidRule::kWinding));
  EXPECT_TRUE(is_filled(alike, SolidRule::kWinding));
  EXPECT_FALSE(is_filled(hollow, SolidRule::kParity));
  EXPECT_FALSE(is_filled(alike, SolidRule::kParity));
  EXPECT_TRUE(is_filled(hollow, SolidRule::kEnclosed));
  EXPECT_TRUE(is_filled(alike, SolidRule::kEnclosed));
}

TEST(RulesOracle, RowsOfOpenMeshesAreCounted) {
  const Solid soup = voxelize_solid(make_solid(SolidKind::kSoup, 5, 32), 32, SolidRule::kWinding);
  EXPECT_GT(soup.rows, 20u);
  EXPECT_GT(soup.open_rows, 10u);
  EXPECT_GT(soup.odd_rows, 10u);
  EXPECT_LE(soup.odd_rows, soup.open_rows);
}

TEST(RulesOracle, ThinVoxelsAreInTheShell) {
  for (const SolidKind kind : kClosedSolids) {
    SCOPED_TRACE(kind_name(kind));
    const Triangles mesh = make_solid(kind, 4, 16);
    const Voxels shell = voxelize(mesh, {{0, 0, 0}, 16});
    const Voxels thin = voxelize_thin(mesh, {{0, 0, 0}, 16});
    EXPECT_LE(thin.count(), shell.count());
    EXPECT_GT(thin.count(), shell.count() / 3);
    for_each_voxel(
        16, [&](int x, int y, int z) { ASSERT_TRUE(!thin.at(x, y, z) || shell.at(x, y, z)); });
  }
}

// If two voxels share a face, and the rule kThin sets neither of them, their centers have the same
// winding number.
TEST(RulesOracle, ThinVoxelsSeparate) {
  for (const SolidKind kind : kClosedSolids) {
    SCOPED_TRACE(kind_name(kind));
    const Triangles mesh = make_solid(kind, 6, 16);
    const Voxels thin = voxelize_thin(mesh, {{0, 0, 0}, 16});
    for_each_voxel(16, [&](int x, int y, int z) {
      if (thin.at(x, y, z)) return;
      const int here = winding_number(mesh, center(x, y, z), 0);
      if (x > 0 && !thin.at(x - 1, y, z)) {
        ASSERT_EQ(winding_number(mesh, center(x - 1, y, z), 0), here);
      }
      if (y > 0 && !thin.at(x, y - 1, z)) {
        ASSERT_EQ(winding_number(mesh, center(x, y - 1, z), 0), here);
      }
      if (z > 0 && !thin.at(x, y, z - 1)) {
        ASSERT_EQ(winding_number(mesh, center(x, y, z - 1), 0), here);
      }
    });
  }
}

}  // namespace
}  // namespace oracle
