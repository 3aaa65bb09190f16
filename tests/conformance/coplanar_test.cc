// Several triangles in one plane. Where one of them covers a cube, the CPU backend ignores the
// others (SubvolumeBuild::covering()), unless one of them leaves the plane.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include "tests/conformance/harness.h"
#include "tests/oracle/solid/rules.h"

namespace voxdag {
namespace {

using Coplanar = Conformance;
VOXDAG_FOR_ALL_BACKENDS(Coplanar);

constexpr uint32_t kPlaneGridLevels =
    8;  // 256 voxels per edge, so that slanted planes get into the memo
constexpr int64_t kMiddle = 128 * oracle::kUnits + 1;

// A plane through the middle of the grid.
struct TestPlane {
  std::array<int64_t, 3> n;

  int up() const {
    int axis = 0;
    for (int a = 1; a < 3; ++a)
      if (std::abs(n[a]) > std::abs(n[axis])) axis = a;
    return axis;
  }
  // Returns a point of the plane, `dp` and `dq` steps from the middle along the other two axes.
  // The length of a step is chosen so that the point has odd coordinates.
  oracle::Point at(int64_t dp, int64_t dq) const {
    const int u = up(), p = (u + 1) % 3, q = (u + 2) % 3;
    oracle::Point out;
    out[p] = kMiddle + 2 * dp * n[u];
    out[q] = kMiddle + 2 * dq * n[u];
    out[u] = kMiddle - 2 * (dp * n[p] + dq * n[q]);
    return out;
  }
};

// Returns a triangle that covers the grid, two that cover half of it each, and three random ones.
// The last one is `off` units out of the plane.
oracle::Triangles scene_in(const TestPlane& plane, oracle::Random& random, int64_t off) {
  const int64_t far = 200 * oracle::kUnits / std::abs(plane.n[plane.up()]);
  oracle::Triangles out = {
      {plane.at(-2 * far, -2 * far), plane.at(6 * far, -2 * far), plane.at(-2 * far, 6 * far)},
      {plane.at(-far, -far), plane.at(far, -far), plane.at(far, far)},
      {plane.at(-far, -far), plane.at(far, far), plane.at(-far, far)}};
  for (int i = 0; i < 3; ++i) {
    oracle::Triangle t;
    for (oracle::Point& p : t) p = plane.at(random.between(-far, far), random.between(-far, far));
    out.push_back(t);
  }
  for (oracle::Point& p : out.back()) p[plane.up()] += off;
  return out;
}

// Calls check(scene) for planes of several directions, without and with a triangle that is one unit
// step (2 units, because coordinates are odd) or a voxel out of the plane.
template <class Check>
void for_each_scene(Check check) {
  oracle::Random random(41);
  for (const TestPlane& plane :
       {TestPlane{{0, 0, 1}}, TestPlane{{1, 0, 0}}, TestPlane{{1, 0, -1}}, TestPlane{{-90, 7, 41}}})
    for (const int64_t off : {0, 2, 256}) {
      SCOPED_TRACE(testing::Message() << "normal " << plane.n[0] << ' ' << plane.n[1] << ' '
                                      << plane.n[2] << ", off " << off);
      check(scene_in(plane, random, off));
      if (testing::Test::HasFailure()) return;
    }
}

// Returns 16^3 voxels around the random triangles' first vertices, and the middle of the grid.
std::vector<oracle::Region> regions_of(const oracle::Triangles& scene) {
  std::vector<oracle::Region> out = {{{120, 120, 120}, 16}};
  for (size_t i = 3; i < scene.size(); ++i) {
    oracle::Region region{{0, 0, 0}, 16};
    for (int a = 0; a < 3; ++a)
      region.low[a] = std::clamp<int64_t>(scene[i][0][a] / oracle::kUnits - 8, 0, 240) / 4 * 4;
    out.push_back(region);
  }
  return out;
}

TEST_P(Coplanar, ShellEqualsTheOracle) {
  const auto backend = open();
  for_each_scene([&](const oracle::Triangles& scene) {
    const Built built = build(*backend, {kPlaneGridLevels, Cube{}, 64}, scene);
    for (const oracle::Region& region : regions_of(scene))
      EXPECT_TRUE(voxels_of(built.dag, Cube{}, kPlaneGridLevels, region) ==
                  oracle::voxelize(scene, region));
  });
}

TEST_P(Coplanar, ThinEqualsTheOracle) {
  const auto backend = open();
  if (!traits_of(VoxelRule::kThin).is_parallel && backend->name() != "cpu")
    GTEST_SKIP() << GetParam().name << " does not have the rule";
  for_each_scene([&](const oracle::Triangles& scene) {
    const Built built =
        build(*backend, {kPlaneGridLevels, Cube{}, 64, nullptr, VoxelRule::kThin}, scene);
    for (const oracle::Region& region : regions_of(scene))
      EXPECT_TRUE(voxels_of(built.dag, Cube{}, kPlaneGridLevels, region) ==
                  oracle::voxelize_thin(scene, region));
  });
}

}  // namespace
}  // namespace voxdag
