#include <gtest/gtest.h>

#include "tests/oracle/solid/rules.h"
#include "tests/unit/core/backend/cpu/tiles.h"

namespace voxdag::cpu {
namespace {

// Calls check(triangle, region) for triangles of every kind, in tiles of every size, at the origin
// and at random positions in a grid of 2^20 voxels per edge.
template <class Check>
void for_many_triangles(int rounds, Check check) {
  oracle::Random random(1);
  for (const oracle::SceneKind kind : oracle::kAllKinds)
    for (int round = 0; round < rounds; ++round) {
      const int size_log2 = 2 + round % 5;
      oracle::Region region = random_region(random, size_log2);
      if (round % 3 == 0) region.low = {0, 0, 0};
      const uint64_t seed = static_cast<uint64_t>(round);
      SCOPED_TRACE(testing::Message()
                   << oracle::kind_name(kind) << ", edge " << region.edge << ", round " << round);
      for (const oracle::Triangle& t : oracle::make_scene(kind, seed, region, 4)) check(t, region);
      if (testing::Test::HasFailure()) return;
    }
}

// Compares the voxels that every kernel sets with the oracle's, for both rules (kShell and kThin).
// `inside`: true if the triangle covers the region (triangle_set.h).
void expect_right(const oracle::Triangle& t, bool inside, const oracle::Region& region) {
  const Padded<int32_t> narrow(t);
  const oracle::Voxels shell = oracle::voxelize({t}, region);
  const oracle::Voxels thin = oracle::voxelize_thin({t}, region);
  for (const Kernels* kernels : all_kernels()) {
    EXPECT_TRUE(drawn(narrow.triangle, inside, region, kernels->draw) == shell) << kernels->name;
    EXPECT_TRUE(drawn<ThinTriangle>(narrow.triangle, inside, region, kernels->draw_thin) == thin)
        << kernels->name;
  }
}

// For the rule kShell, every kernel sets exactly the voxels that the oracle's separating-axis test
// finds. For the rule kThin, it sets exactly the voxels in which the triangle crosses a row,
// according to the oracle.
TEST(Draw, KernelsEqualOracle) {
  for_many_triangles(120, [](const oracle::Triangle& t, const oracle::Region& region) {
    if (is_narrow(t)) expect_right(t, false, region);
  });
}

// draw_wide() and draw_thin_wide(), which use 128-bit integers, set exactly the oracle's voxels,
// both for wide and for narrow triangles (triangle_set.h).
TEST(Draw, WideEqualsOracle) {
  int wide_ones = 0;
  for_many_triangles(40, [&](const oracle::Triangle& t, const oracle::Region& region) {
    const Padded<int64_t> wide(t);
    wide_ones += !is_narrow(t);
    EXPECT_TRUE(drawn(wide.triangle, false, region, draw_wide) == oracle::voxelize({t}, region));
    EXPECT_TRUE(drawn<ThinTriangle>(wide.triangle, false, region, draw_thin_wide) ==
                oracle::voxelize_thin({t}, region));
  });
  EXPECT_GT(wide_ones, 50);
}

// The kernels round the heights of the triangle's plane (heights.h). They set the oracle's voxels
// even if the plane passes through voxel corners or just misses them, where rounding could change
// the result. The planes' slopes are ratios of small numbers, so that this happens often.
TEST(Draw, AmbiguousHeightsAreExact) {
  oracle::Random random(2);
  const oracle::Region region{{512, 1024, 4096}, 16};
  for (int round = 0; round < 3000; ++round) {
    // The triangle is in the plane x = (p y + q z) / n + offset and extends beyond the tile.
    const int64_t n = 256 * random.between(1, 8), p = random.between(-n, n);
    const int64_t q = random.between(-n, n), offset = random.between(-600, 600) * 2;
    const int up = static_cast<int>(random.between(0, 2));
    oracle::Triangle t;
    const int64_t corners[3][2] = {{-4, -4}, {20, -4}, {-4, 44}};
    for (int i = 0; i < 3; ++i) {
      const int64_t y = corners[i][0] * n, z = corners[i][1] * n;
      const int64_t height = 8 * 256 + p * corners[i][0] + q * corners[i][1] + offset;
      t[i][up] = region.low[up] * 256 + (height | 1);
      t[i][(up + 1) % 3] = (region.low[(up + 1) % 3] * 256 + y) | 1;
      t[i][(up + 2) % 3] = (region.low[(up + 2) % 3] * 256 + z) | 1;
    }
    SCOPED_TRACE(testing::Message() << "round " << round);
    expect_right(t, false, region);
    if (HasFailure()) return;
  }
}

// For each row of voxels, the kernels compute in doubles the first and the last voxel inside an
// edge (edge_bounds.h). They set the oracle's voxels even if edges pass through voxel corners or
// just miss them, where rounding could change the result. The test has edges of every length, and
// some edges parallel to an axis.
TEST(Draw, AmbiguousEdgesAreExact) {
  oracle::Random random(4);
  const int64_t middle = int64_t{1} << 19;
  const oracle::Region region{{middle, middle, middle}, 16};
  for (int round = 0; round < 6000; ++round) {
    const int64_t length = int64_t{1} << random.between(4, 26);
    oracle::Triangle t;
    for (int a = 0; a < 3; ++a) {
      const int64_t corner = (middle + random.between(0, 16)) * 256 + random.between(-1, 1);
      const int64_t half = random.between(0, 3) == 0 ? 0 : random.between(-length, length);
      t[0][a] = (corner - half) | 1;
      t[1][a] = (corner + half + random.between(-2, 2)) | 1;
      t[2][a] = (corner + random.between(-length, length)) | 1;
    }
    SCOPED_TRACE(testing::Message() << "round " << round);
    expect_right(t, false, region);
    if (HasFailure()) return;
  }
}

// With the rule kThin, the kernels set the oracle's voxels even if planes and edges of triangles
// pass through the centers of voxels, of their faces or of their edges, or just miss these centers.
TEST(Draw, AmbiguousCentersAreExact) {
  oracle::Random random(5);
  const int64_t middle = int64_t{1} << 19;
  const oracle::Region region{{middle, middle, middle}, 16};
  for (int round = 0; round < 3000; ++round) {
    const int64_t length = int64_t{1} << random.between(4, 20);
    oracle::Triangle t;
    for (int a = 0; a < 3; ++a) {
      const int64_t at = middle * 256 + 128 * random.between(0, 32);
      const int64_t half = random.between(-length, length) | 1;
      const int64_t other = random.coin() ? half : random.coin() ? -half : random.odd(-500, 500);
      t[0][a] = at - half;
      t[1][a] = at + half + (random.coin() ? 0 : 2 * random.between(-1, 1));
      t[2][a] = middle * 256 + 128 * random.between(0, 32) + other;
    }
    SCOPED_TRACE(testing::Message() << "round " << round);
    expect_right(t, false, region);
    if (HasFailure()) return;
  }
}

// If a triangle covers a cube (triangle_set.h), its edges do not matter, and drawing only its plane
// sets the oracle's voxels.
TEST(Draw, InsideIsThePlaneOnly) {
  oracle::Random random(3);
  int covered = 0;
  for (int round = 0; round < 400; ++round) {
    const oracle::Region around = random_region(random, 9);
    oracle::Region region{around.low, 32};
    for (int64_t& low : region.low) low += 32 * random.between(0, 15);
    const auto scene =
        oracle::make_scene(oracle::SceneKind::kSpanning, static_cast<uint64_t>(round), around, 9);
    for (const oracle::Triangle& t : scene) {
      if (!is_narrow(t)) continue;
      const Padded<int32_t> narrow(t);
      const LatticeCube box = box_of(region);
      const Octants octants = portable_kernels().test_octants(narrow.triangle, box, false);
      for (int c = 0; c < 8; ++c) {
        if (!(octants.inside >> c & 1)) continue;
        ++covered;
        oracle::Region child{region.low, region.edge / 2};
        for (int a = 0; a < 3; ++a) child.low[a] += (c >> (2 - a) & 1) * child.edge;
        expect_right(t, true, child);
      }
    }
  }
  EXPECT_GT(covered, 50);
}

}  // namespace
}  // namespace voxdag::cpu
