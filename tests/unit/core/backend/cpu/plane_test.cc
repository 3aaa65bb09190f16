#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <memory>

#include "core/backend/cpu/memo/plane_memo.h"
#include "tests/unit/core/backend/cpu/tiles.h"

namespace voxdag::cpu {
namespace {

// The objects that build nodes: the tables of a subvolume, the reducer, and the plane memo.
struct Workshop {
  Workshop(const Kernels& kernels, VoxelRule its_rule)
      : tables(memory, 10),
        full(tables),
        reducer(tables, full, kernels),
        planes(memory, tables, full, reducer, kernels, its_rule),
        rule(its_rule) {}

  MemoryBudget budget{uint64_t{256} << 20};
  PagePool pool;
  PooledMemory memory{budget, pool};
  SubDagTables tables;
  FullNodes full;
  TileReducer reducer;
  PlaneMemo planes;
  VoxelRule rule;
};

// Returns the node of a cube that the triangle covers (triangle_set.h). Makes it without the plane
// memo, by drawing the triangle tile by tile.
NodeRef drawn_node(Workshop& shop, const NarrowTriangle& t, const LatticeCube& box, int size_log2,
                   TileBricks& tile) {
  if (size_log2 > kTileLog2) {
    NodeRef children[8];
    for (int c = 0; c < 8; ++c)
      children[c] = drawn_node(shop, t, box.child(c), size_log2 - 1, tile);
    return shop.tables.add_node(size_log2, children);
  }
  if (shop.rule == VoxelRule::kThin) {
    ThinTriangle<int32_t> in_tile;
    if (in_tile.set_up(t, true, box)) portable_kernels().draw_thin(in_tile, tile);
  } else {
    TileTriangle<int32_t> in_tile;
    if (in_tile.set_up(t, true, box)) portable_kernels().draw(in_tile, tile);
  }
  return shop.reducer.reduce_bricks(tile, size_log2);
}

// Returns a triangle in a plane with the normal `n` through the middle of the region. The triangle
// extends far beyond the region.
oracle::Triangle covering(const oracle::Region& region, const std::array<int64_t, 3>& n,
                          oracle::Random& random) {
  oracle::Triangle t;
  int up = 0;
  for (int a = 1; a < 3; ++a)
    if (std::abs(n[a]) > std::abs(n[up])) up = a;
  const int p = (up + 1) % 3, q = (up + 2) % 3;
  const int64_t reach = 256 * region.edge / std::abs(n[up]) + 1;
  const int64_t corners[3][2] = {{-reach, -reach}, {2 * reach, -reach}, {-reach, 2 * reach}};
  const int64_t offset = random.between(-region.edge * 100, region.edge * 100) * 2;
  for (int i = 0; i < 3; ++i) {
    // The displacements along the axes p and q are multiples of n[up], so the displacement along
    // `up` is an integer, and the vertices are exactly in the plane.
    const int64_t dp = corners[i][0] * 2 * n[up], dq = corners[i][1] * 2 * n[up];
    const int64_t middle = region.edge * 128 + 1;
    t[i][p] = region.low[p] * 256 + middle + dp;
    t[i][q] = region.low[q] * 256 + middle + dq;
    t[i][up] = region.low[up] * 256 + middle + offset - (dp * n[p] + dq * n[q]) / n[up];
  }
  return t;
}

// Compares the memo's node of a cube with the node that drawn_node() makes. Does the same for three
// of the cube's children, recursively down to the smallest cubes that the memo accepts. Returns the
// number of compared cubes.
int compare(Workshop& by_memo, Workshop& by_drawing, const TriangleSet& set, const LatticeCube& box,
            int size_log2, TileBricks& tile) {
  const OctreeCounts before = by_memo.tables.counts();
  NodeRef node;
  EXPECT_TRUE(by_memo.planes.build(set, {0}, box, size_log2, node));
  const OctreeCounts counts = by_memo.tables.counts() - before;
  const OctreeCounts drawn_before = by_drawing.tables.counts();
  const NodeRef truth = drawn_node(by_drawing, set.narrow({0}), box, size_log2, tile);
  const OctreeCounts drawn_counts = by_drawing.tables.counts() - drawn_before;
  EXPECT_EQ(node.exists, truth.exists);
  EXPECT_EQ(node.hash, truth.hash);
  EXPECT_EQ(counts.voxels, drawn_counts.voxels);
  EXPECT_EQ(counts.nodes, drawn_counts.nodes);
  int compared = 1;
  if (size_log2 > PlaneMemo::kSmallestLog2 && !testing::Test::HasFailure())
    for (int c = 0; c < 8; c += 3)
      compared += compare(by_memo, by_drawing, set, box.child(c), size_log2 - 1, tile);
  return compared;
}

// Builds a cube so often that the memo makes all kinds of nodes for the plane's direction.
void use_often(Workshop& shop, const TriangleSet& set, const LatticeCube& box, int size_log2) {
  NodeRef node;
  for (int i = 0; i < 200; ++i) EXPECT_TRUE(shop.planes.build(set, {0}, box, size_log2, node));
}

// Compares the nodes that PlaneMemo returns with nodes built by drawing the triangle. Both must
// exist for the same cubes, and have the same hashes and counts. The components of the normals are
// at most 1 (walls and diagonals), 12 or 300, each in a third of the rounds.
void expect_memo_equals_drawing(VoxelRule rule) {
  oracle::Random random(6);
  const auto tile = std::make_unique<TileBricks>();
  int compared = 0;
  for (int round = 0; round < 90; ++round) {
    std::array<int64_t, 3> n{};
    const int64_t largest = round % 3 == 0 ? 1 : round % 3 == 1 ? 12 : 300;
    while (n[0] == 0 && n[1] == 0 && n[2] == 0)
      for (int64_t& x : n) x = random.between(-largest, largest);
    const int size_log2 = static_cast<int>(random.between(6, 8));
    const oracle::Region region = random_region(random, size_log2);
    const oracle::Triangle t = covering(region, n, random);
    if (!is_narrow(t)) continue;
    SCOPED_TRACE(testing::Message() << "round " << round << ", normal " << n[0] << ' ' << n[1]
                                    << ' ' << n[2] << ", edge " << region.edge);
    const std::vector<const Kernels*> kernels = all_kernels();
    Workshop by_memo(*kernels[static_cast<size_t>(round) % kernels.size()], rule);
    Workshop by_drawing(portable_kernels(), rule);
    TriangleSet set(by_memo.memory);
    set.add(axis_major(oracle::fixed(t)));
    // The memo adds a triangle's plane only after build() was called for enough cubes that the
    // triangle covers. It refuses some planes, so `found` can remain false.
    NodeRef node;
    bool found = false;
    for (int i = 0; i < 40 && !found; ++i)
      found = by_memo.planes.build(set, {0}, box_of(region), size_log2, node);
    if (!found) continue;
    // In every second round, the direction has enough tiles for nodes of 16^3 voxels.
    if (round % 2 == 1) use_often(by_memo, set, box_of(region), size_log2);
    compared += compare(by_memo, by_drawing, set, box_of(region), size_log2, *tile);
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GT(compared, 500);
}

TEST(Planes, NodesFromTheMemoEqualDrawnOnes) { expect_memo_equals_drawing(VoxelRule::kShell); }
TEST(Planes, ThinNodesFromTheMemoEqualDrawnOnes) { expect_memo_equals_drawing(VoxelRule::kThin); }

// A memo that knows the plane of a triangle.
struct PlaneOfTriangle {
  explicit PlaneOfTriangle(const oracle::Triangle& t)
      : shop(portable_kernels(), VoxelRule::kShell), set(shop.memory) {
    set.add(axis_major(oracle::fixed(t)));
    for (int i = 0; i < 40 && !found; ++i) found = shop.planes.find_plane(set, {0}, 8);
  }

  struct Tile {
    NodeRef node;
    OctreeCounts counts;
    uint64_t filled = 0;
  };
  Tile tile(InnerSides inner, int64_t f, int size_log2) {
    const OctreeCounts before = shop.tables.counts();
    Tile tile;
    EXPECT_TRUE(shop.planes.build_tile(*found, inner, f, size_log2, tile.node, tile.filled));
    tile.counts = shop.tables.counts() - before;
    return tile;
  }

  Workshop shop;
  TriangleSet set;
  std::optional<PlaneMemo::Found> found;
};

// Tiles of a plane with inner sides are the same from nodes of 8^3 and of 16^3 voxels.
TEST(Planes, LargeAndSmallNodesGiveTheSameTilesOfSolids) {
  oracle::Random random(8);
  int compared = 0;
  for (int round = 0; round < 40; ++round) {
    std::array<int64_t, 3> n;
    for (int64_t& x : n) x = random.between(20, 300) * (random.between(0, 1) * 2 - 1);
    const oracle::Triangle t = covering(random_region(random, 8), n, random);
    if (!is_narrow(t)) continue;
    SCOPED_TRACE(testing::Message() << "normal " << n[0] << ' ' << n[1] << ' ' << n[2]);
    PlaneOfTriangle large(t);
    if (!large.found) continue;
    const Plane& plane = large.found->plane;
    for (const InnerSides inner : {InnerSides{true, false}, InnerSides{false, true}}) {
      for (int i = 0; i < 200; ++i) large.tile(inner, -plane.up, kTileLog2);
      PlaneOfTriangle small(t);
      for (int i = 0; i < 60; ++i) {
        const int size_log2 = 5 + i % 2;
        const int64_t last = (1 << size_log2) - 1;
        const int64_t f = random.between(-plane.up - last * plane.rising(),
                                         plane.width - plane.up - last * plane.falling());
        const auto a = large.tile(inner, f, size_log2), b = small.tile(inner, f, size_log2);
        ASSERT_TRUE(a.node.exists && b.node.exists);
        ASSERT_EQ(a.node.hash, b.node.hash);
        ASSERT_EQ(a.filled, b.filled);
        ASSERT_EQ(a.counts.nodes, b.counts.nodes);
        ASSERT_EQ(a.counts.voxels, b.counts.voxels);
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 1000);
}

// Plane::fits() rejects large cubes for a plane with a huge normal, because values of the plane in
// such cubes exceed 62 bits. The memo then does not use the plane.
TEST(Planes, HugeNormalsAreNotUsedForLargeCubes) {
  const oracle::Triangle t{
      {{1, 1, 100000001}, {(1 << 28) - 1, 3, 7}, {5, (1 << 28) - 3, 100000007}}};
  const Padded<int32_t> narrow(t);
  const Plane plane = plane_of(narrow.triangle, VoxelRule::kShell);
  EXPECT_TRUE(plane.fits(kTileLog2 - 1));
  EXPECT_FALSE(plane.fits(12));
}

}  // namespace
}  // namespace voxdag::cpu
