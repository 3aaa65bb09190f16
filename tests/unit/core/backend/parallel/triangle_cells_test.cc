// touched_cells() must report a cell if and only if the triangle touches it by the definition in
// core/geometry/overlap.h.
#include "core/backend/parallel/voxelize/triangle_cells.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/oracle/core_types.h"
#include "tests/oracle/scenes.h"

namespace voxdag::parallel {
namespace {

struct Tally {
  uint64_t blocks = 0, cells = 0;
};

template <int N>
void expect_defined(const FixedTriangle& t, const int64_t (&low)[3], int shift, Tally& tally) {
  const uint64_t expected = touched_cells_one_by_one<N>(t, low, shift);
  ASSERT_EQ(touched_cells<N>(t, low, shift), expected)
      << "block of " << N << "^3 cells of 2^" << shift << " at " << low[0] << ' ' << low[1] << ' '
      << low[2] << ", triangle at " << t.v[0][0] << ' ' << t.v[0][1] << ' ' << t.v[0][2];
  ++tally.blocks;
  tally.cells += static_cast<uint64_t>(popcount64(expected));
}

// Compares touched_cells() with the definition for blocks (groups of 4^3 or 2^3 cells) of many
// sizes, in or near the triangle's bounding box.
void expect_defined_around(const FixedTriangle& t, oracle::Random& random, Tally& tally) {
  for (int shift = 8; shift <= 27; shift += static_cast<int>(random.between(1, 3)))
    for (int i = 0; i < 4; ++i) {
      int64_t low[3];
      for (int a = 0; a < 3; ++a) {
        const int64_t near = t.v[random.between(0, 2)][a] + t.v[random.between(0, 2)][a];
        low[a] = ((near >> (shift + 1)) + random.between(-3, 1)) * (int64_t{1} << shift);
      }
      if (shift < 27) expect_defined<4>(t, low, std::min(shift, 26), tally);
      expect_defined<2>(t, low, shift, tally);
    }
}

TEST(TouchedCells, EqualsTheDefinitionOnAllKinds) {
  oracle::Random random(3);
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    SCOPED_TRACE(oracle::kind_name(kind));
    Tally tally;
    for (const int edge : {16, 64, 4096, 1 << 20}) {
      const int64_t far = (int64_t{1} << 20) - edge;
      const oracle::Region region{{far, far / 2 / edge * edge, 0}, edge};
      for (const auto& t : oracle::make_scene(kind, static_cast<uint64_t>(edge), region, 60)) {
        expect_defined_around(oracle::fixed(t), random, tally);
        if (testing::Test::HasFatalFailure()) return;
      }
    }
    EXPECT_GT(tally.cells, tally.blocks / 100) << "few blocks were touched at all";
  }
}

// touched_cells() is right for triangles at, just below and just above the largest size for which
// it uses 64-bit products. The triangles' normals are as long as possible at this size, so that the
// products are as large as possible.
TEST(TouchedCells, EqualsTheDefinitionAtTheLimitOfNarrow) {
  oracle::Random random(4);
  Tally tally;
  for (int i = 0; i < 4000; ++i) {
    const int64_t extent = kNarrowUnits + 2 * random.between(-2, 1);
    FixedTriangle t;
    int64_t low[3];
    const int shift = static_cast<int>(random.between(8, 26));
    for (int a = 0; a < 3; ++a) {
      const int64_t at = random.odd(-kNarrowUnits, kNarrowUnits);
      for (auto& v : t.v) v[a] = at + (random.coin() ? extent : 0);
      if (random.coin()) t.v[random.between(0, 2)][a] = at + 2 * random.between(0, extent / 2);
      low[a] = (random.between(at, at + extent) >> shift) * (int64_t{1} << shift);
    }
    expect_defined<4>(t, low, shift, tally);
    expect_defined<2>(t, low, shift + 1, tally);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(tally.cells, tally.blocks / 10);
}

// touched_cells() is right for triangles with vertices a few units from the cells' corners, whose
// plane or edges just touch or just miss a cell.
TEST(TouchedCells, EqualsTheDefinitionNearCorners) {
  oracle::Random random(5);
  Tally tally;
  for (int i = 0; i < 40000; ++i) {
    const int shift = static_cast<int>(random.between(8, 12));
    const int64_t near = i % 2 ? 3 : 40, corners = random.between(1, 4);
    const int64_t low[3] = {0, 0, 0};
    FixedTriangle t;
    for (auto& v : t.v)
      for (int64_t& x : v)
        x = random.between(0, corners) * (int64_t{1} << shift) + random.odd(-near, near);
    expect_defined<4>(t, low, shift, tally);
    expect_defined<2>(t, low, shift + 1, tally);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(tally.cells, tally.blocks);
}

// One TriangleOnLattice, which is made for a triangle and a size of cells, finds the touched cells
// of blocks at any offset.
TEST(TouchedCells, BlocksOfOneLattice) {
  oracle::Random random(6);
  Tally tally;
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    SCOPED_TRACE(oracle::kind_name(kind));
    for (const auto& triangle : oracle::make_scene(kind, 8, {{1024, 0, 4096}, 16}, 50)) {
      const FixedTriangle t = oracle::fixed(triangle);
      const int64_t low[3] = {1024 * 256, 0, 4096 * 256};
      if (!is_narrow(t) || !box_touches_cube(t, low, 12)) continue;
      const TriangleOnLattice lattice(t, low, 8);
      for (int i = 0; i < 64; ++i) {
        int at[3];
        int64_t block_low[3];
        for (int a = 0; a < 3; ++a) {
          at[a] = static_cast<int>(random.between(0, 12));
          block_low[a] = low[a] + at[a] * 256;
        }
        const uint64_t expected = touched_cells_one_by_one<4>(t, block_low, 8);
        ASSERT_EQ(lattice.touched<4>(at), expected);
        tally.cells += static_cast<uint64_t>(popcount64(expected));
      }
    }
  }
  EXPECT_GT(tally.cells, 1000u);
}

// The cells of a block are numbered in the same order as children and as the bits of a brick.
TEST(TouchedCells, BitsAreMortonCodes) {
  for (int i = 0; i < 64; ++i) {
    uint32_t k[3];
    morton_decode(static_cast<uint64_t>(i), k[0], k[1], k[2]);
    int bit = 0;
    for (int a = 0; a < 3; ++a) bit += cell_bit(a, static_cast<int>(k[a]));
    EXPECT_EQ(bit, i);
  }
}

}  // namespace
}  // namespace voxdag::parallel
