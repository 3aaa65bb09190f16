#include <gtest/gtest.h>

#include "tests/oracle/overlap.h"
#include "tests/unit/core/backend/cpu/tiles.h"

namespace voxdag::cpu {
namespace {

struct Tally {
  int touched = 0, reported = 0, inside = 0;
};

// Checks one result of the octant test. Every child that the triangle touches must be reported.
// Every child that is reported as inside the triangle must also be reported as touched.
void check(const Octants& octants, const oracle::Triangle& t, const oracle::Region& region,
           Tally& tally) {
  for (int c = 0; c < 8; ++c) {
    oracle::Point low;
    const int64_t half = region.edge / 2 * oracle::kUnits;
    for (int a = 0; a < 3; ++a) low[a] = region.low[a] * oracle::kUnits + (c >> (2 - a) & 1) * half;
    const bool touched = oracle::touches(t, low, half);
    tally.touched += touched;
    tally.reported += octants.touched >> c & 1;
    tally.inside += octants.inside >> c & 1;
    EXPECT_TRUE(!touched || (octants.touched >> c & 1)) << "child " << c;
  }
  EXPECT_EQ(octants.inside & ~octants.touched, 0u);
}

// The octant test reports every touched child, and few children that are not touched, for cubes of
// every size up to the largest grid.
TEST(Octants, NoTouchedChildIsLeftOut) {
  oracle::Random random(4);
  Tally portable, avx2, wide;
  for (const oracle::SceneKind kind : oracle::kAllKinds)
    for (int round = 0; round < 200; ++round) {
      const oracle::Region region = random_region(random, static_cast<int>(random.between(2, 20)));
      const LatticeCube box = box_of(region);
      SCOPED_TRACE(testing::Message()
                   << oracle::kind_name(kind) << ", edge " << region.edge << ", round " << round);
      const uint64_t seed = static_cast<uint64_t>(round);
      for (const oracle::Triangle& t : oracle::make_scene(kind, seed, region, 2)) {
        const Padded<int64_t> as_wide(t);
        // The octant test is called only for triangles that may touch the cube.
        if (box.misses(as_wide.triangle)) continue;
        check(test_octants_wide(as_wide.triangle, box, false), t, region, wide);
        if (!is_narrow(t)) continue;
        const Padded<int32_t> narrow(t);
        check(portable_kernels().test_octants(narrow.triangle, box, false), t, region, portable);
        if (const Kernels* kernels = avx2_kernels())
          check(kernels->test_octants(narrow.triangle, box, false), t, region, avx2);
      }
      if (HasFailure()) return;
    }
  for (const Tally& tally : {portable, avx2, wide}) {
    if (tally.touched == 0) continue;  // this machine has no AVX2
    EXPECT_GT(tally.inside, 20);
    EXPECT_LT(tally.reported, tally.touched * 1.3);
  }
}

// If a triangle covers a cube (triangle_set.h), it also covers the cube's children that its plane
// touches.
TEST(Octants, InsideStaysInside) {
  const oracle::Region region{{0, 0, 0}, 64};
  const Padded<int32_t> narrow(
      oracle::Triangle{{{-9001, -9001, 4001}, {60001, -9001, 6001}, {-9001, 60001, 5001}}});
  for (const Kernels* kernels : {&portable_kernels(), avx2_kernels()}) {
    if (!kernels) continue;
    const Octants octants = kernels->test_octants(narrow.triangle, box_of(region), true);
    EXPECT_EQ(octants.touched, octants.inside);
    EXPECT_EQ(octants.touched, 0x55u);  // z below the middle
  }
}

}  // namespace
}  // namespace voxdag::cpu
