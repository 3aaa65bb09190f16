#include "core/color/rule/bake_region.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "core/base/integers.h"
#include "core/color/blocks/region.h"
#include "core/color/color_of.h"
#include "tests/oracle/overlap.h"
#include "tests/unit/core/color/looks.h"

namespace voxdag {
namespace {

using oracle::SceneKind;

// Color sums of cells, by the cells' positions in the color grid.
using Sums = std::map<std::array<uint32_t, 3>, ColorSum>;

void collect(const ColorGrid& grid, const Cube& region, const std::vector<ColoredCell>& cells,
             Sums& sums) {
  const uint32_t down = grid.color_levels - region.level;
  uint32_t least = 0;
  for (const ColoredCell& cell : cells) {
    EXPECT_GE(cell.code, least);  // in Morton order, each once
    EXPECT_GT(cell.sum.weight, 0u);
    least = cell.code + 1;
    std::array<uint32_t, 3> at;
    morton_decode(cell.code, at[0], at[1], at[2]);
    for (size_t a = 0; a < 3; ++a) at[a] += region.position[a] << down;
    EXPECT_TRUE(sums.emplace(at, cell.sum).second);
  }
}

// Bakes a complete color grid. The baked regions are all cubes of `level`, one after the other.
Sums bake_grid(const ColorGrid& grid, uint32_t level, const std::vector<FixedSurface>& surfaces,
               const TestLooks& looks) {
  Sums sums;
  RegionBaker<const TestImages> baker(grid, looks.materials, looks.images);
  std::vector<ColoredCell> cells;
  for (uint64_t code = 0; code < uint64_t{1} << (3 * level); ++code) {
    Cube region{level, {}};
    morton_decode(code, region.position[0], region.position[1], region.position[2]);
    baker.bake(region, surfaces, cells);
    collect(grid, region, cells, sums);
  }
  return sums;
}

std::vector<FixedSurface> scene(const TestLooks& looks, SceneKind kind, uint64_t seed,
                                const ColorGrid& grid, int count) {
  const oracle::Region whole{{0, 0, 0}, 1 << grid.levels};
  return looks.surfaces(oracle::make_scene(kind, seed, whole, count), seed);
}

// The baked cells are the cells that the oracle's overlap test finds, for color grids as fine as
// the voxel grid and coarser ones.
TEST(BakeRegion, CellsAreThoseThatTrianglesTouch) {
  const TestLooks looks;
  size_t set = 0;
  for (const SceneKind kind : oracle::kAllKinds)
    for (const ColorGrid grid : {ColorGrid{4, 4}, ColorGrid{5, 3}, ColorGrid{9, 3}}) {
      SCOPED_TRACE(oracle::kind_name(kind) + " " + std::to_string(grid.levels));
      const auto surfaces = scene(looks, kind, 7, grid, 12);
      const Sums sums = bake_grid(grid, 0, surfaces, looks);
      const int64_t edge = int64_t{1} << grid.cell_bits();
      const uint32_t cells = 1u << grid.color_levels;
      for (uint32_t x = 0; x < cells; ++x)
        for (uint32_t y = 0; y < cells; ++y)
          for (uint32_t z = 0; z < cells; ++z) {
            const oracle::Point low{x * edge, y * edge, z * edge};
            const bool touched = std::any_of(surfaces.begin(), surfaces.end(), [&](const auto& s) {
              return oracle::touches(plain(s.position), low, edge);
            });
            ASSERT_EQ(sums.count({x, y, z}), touched ? 1u : 0u) << x << " " << y << " " << z;
            set += touched;
          }
    }
  EXPECT_GT(set, 5000u);
}

// Neither the order of the triangles nor the choice of regions affects any sum.
TEST(BakeRegion, SumsAreFunctionsOfTheCell) {
  const TestLooks looks;
  for (const SceneKind kind : oracle::kAllKinds)
    for (const ColorGrid grid : {ColorGrid{4, 4}, ColorGrid{8, 4}}) {
      SCOPED_TRACE(oracle::kind_name(kind));
      auto surfaces = scene(looks, kind, 3, grid, 40);
      const Sums whole = bake_grid(grid, 0, surfaces, looks);
      ASSERT_FALSE(whole.empty());
      EXPECT_EQ(bake_grid(grid, 1, surfaces, looks), whole);
      EXPECT_EQ(bake_grid(grid, 4, surfaces, looks), whole);
      std::reverse(surfaces.begin(), surfaces.end());
      EXPECT_EQ(bake_grid(grid, 0, surfaces, looks), whole);
      std::rotate(surfaces.begin(), surfaces.begin() + 13, surfaces.end());
      EXPECT_EQ(bake_grid(grid, 2, surfaces, looks), whole);
    }
}

// The sums do not depend on the division of the triangles into calls of add(): a triangle that
// covers a cell can come in a later call than a triangle that only touches the cell.
TEST(BakeRegion, TrianglesMayComeInParts) {
  const TestLooks looks;
  for (const SceneKind kind : oracle::kAllKinds) {
    SCOPED_TRACE(oracle::kind_name(kind));
    const ColorGrid grid{8, 4};
    const auto surfaces = scene(looks, kind, 11, grid, 40);
    RegionBaker<const TestImages> baker(grid, looks.materials, looks.images);
    for (const size_t part : {size_t{1}, size_t{7}}) {
      baker.begin(Cube{});
      for (size_t at = 0; at < surfaces.size(); at += part)
        baker.add(std::span(surfaces).subspan(at, std::min(part, surfaces.size() - at)));
      std::vector<ColoredCell> cells;
      baker.finish(cells);
      Sums sums;
      collect(grid, Cube{}, cells, sums);
      EXPECT_EQ(sums, bake_grid(grid, 0, surfaces, looks));
    }
  }
}

// A cell that a triangle covers (docs/color.md) ignores triangles that only touch it. RegionBaker
// adds triangles that only touch a cell at the end of the region, or earlier if there are too many
// of them. The sums are the same in both cases.
TEST(BakeRegion, CellsThatNothingCoversOfManyTriangles) {
  TestLooks looks;
  const ColorGrid grid{10, 2};
  oracle::Random random(5);
  oracle::Triangles triangles;
  for (int i = 0; i < 150000; ++i) {
    const int64_t at = random.odd(1, 1 << 18);
    // These triangles touch cells, but cover no column (docs/color.md). Only the last triangle
    // covers columns, in the first cell.
    triangles.push_back({{{at, 3, 5}, {at | 2, 7, 5}, {at, 3, 9}}});
  }
  triangles.push_back({{{1, 1, 1}, {60001, 60001, 1}, {1, 60001, 1}}});
  std::vector<FixedSurface> surfaces = looks.surfaces(triangles, 1);
  const Sums sums = bake_grid(grid, 0, surfaces, looks);
  std::reverse(surfaces.begin(), surfaces.end());
  EXPECT_EQ(bake_grid(grid, 0, surfaces, looks), sums);
  ASSERT_EQ(sums.size(), 4u);
  EXPECT_GE(sums.at({0, 0, 0}).weight, 64u);
  uint64_t in_others = 0;
  for (uint32_t x = 1; x < 4; ++x) in_others += sums.at({x, 0, 0}).weight;
  EXPECT_GT(in_others, 110000u);
  EXPECT_LT(in_others, 115000u);
}

// Gives each surface one of `colors` random colors, or no change if `colors` is 0.
void make_flat(std::vector<FixedSurface>& surfaces, int colors) {
  oracle::Random random(17);
  std::vector<std::array<uint16_t, 4>> palette(static_cast<size_t>(colors));
  for (auto& color : palette)
    for (uint16_t& c : color) c = static_cast<uint16_t>(random.between(0, 65535));
  for (FixedSurface& surface : surfaces)
    if (colors > 0)
      for (auto& corner : surface.corners)
        corner.color = palette[static_cast<size_t>(&surface - surfaces.data()) % palette.size()];
}

// If all surfaces of a cell have one flat color, the cell's sum is computed from a weight. A white
// image does not change a color, but the surface no longer counts as flat.
TEST(BakeRegion, FlatColorsAddUpLikeImages) {
  TestLooks flat, white;
  white.images.add_white();
  for (Material& material : flat.materials) material.image = Material::kNoImage;
  for (Material& material : white.materials) material.image = 2;
  const ColorGrid grid{7, 5};
  for (const SceneKind kind : oracle::kAllKinds)
    for (const int colors : {1, 3, 100}) {
      SCOPED_TRACE(oracle::kind_name(kind) + " " + std::to_string(colors));
      auto surfaces = scene(flat, kind, 5, grid, 300);
      make_flat(surfaces, colors);
      const Sums sums = bake_grid(grid, 0, surfaces, flat);
      EXPECT_GT(sums.size(), 20u);
      EXPECT_EQ(sums, bake_grid(grid, 0, surfaces, white));
    }
}

// Encoding cells directly gives the same region as encoding their sums, for regions in one piece
// and in eight.
TEST(BakeRegion, EncodesWhatItsSumsGive) {
  TestLooks looks;
  for (size_t i = 0; i < 6; ++i) looks.materials[i].image = Material::kNoImage;
  const ColorGrid grid{8, 6};
  for (const SceneKind kind : oracle::kAllKinds)
    for (const int colors : {0, 1, 3, 100})
      for (const uint32_t level : {0u, 1u}) {
        SCOPED_TRACE(oracle::kind_name(kind) + " " + std::to_string(colors) + " " +
                     std::to_string(level));
        auto surfaces = scene(looks, kind, 13, grid, 200);
        make_flat(surfaces, colors);
        RegionEncoder direct(grid.color_levels), by_sums(grid.color_levels);
        RegionBaker<const TestImages> baker(grid, looks.materials, looks.images);
        std::vector<ColoredCell> cells;
        const uint32_t pieces = 1u << 3 * level, of_piece = (1u << 3 * grid.color_levels) / pieces;
        for (uint32_t piece = 0; piece < pieces; ++piece) {
          const Cube cube = level == 0 ? Cube{} : Cube{}.child(static_cast<int>(piece));
          baker.bake(cube, surfaces, cells);
          by_sums.add(cells, piece * of_piece);
          baker.begin(cube);
          baker.add(surfaces);
          baker.finish(piece * of_piece, direct);
        }
        const EncodedRegion a = direct.finish(0), b = by_sums.finish(0);
        EXPECT_EQ(a.counts, b.counts);
        EXPECT_EQ(a.blocks, b.blocks);
        EXPECT_EQ(a.prefix, b.prefix);
        EXPECT_EQ(a.total, b.total);
      }
}

// Sums from 64-bit and from 128-bit integers are equal. A triangle is baked twice; the second time,
// a vertex is far away in the triangle's plane, so 128 bits are necessary.
TEST(BakeRegion, WideTrianglesCoverWhatNarrowOnesDo) {
  TestLooks looks;
  looks.materials.assign(1, Material{});
  const ColorGrid grid{6, 6};
  const int64_t far = (int64_t{1} << 40) - 1;
  auto one_triangle = [](const oracle::Triangle& triangle) {
    FixedSurface surface;
    surface.position = fixed(triangle);
    return std::vector<FixedSurface>{surface};
  };
  for (const int64_t h : {int64_t{0}, int64_t{1}}) {
    const auto narrow = one_triangle({{{-9999, -9999, 4001 - h * 9000},
                                       {99999, -9999, 4001 + h * 100998},
                                       {-9999, 99999, 4001 - h * 9000}}});
    const auto wide = one_triangle({{{-9999, -9999, 4001 - h * 9000},
                                     {far, -9999, 4001 + h * (far + 999)},
                                     {-9999, far, 4001 - h * 9000}}});
    const Sums few = bake_grid(grid, 0, narrow, looks);
    EXPECT_GE(few.size(), 4096u);
    EXPECT_EQ(bake_grid(grid, 0, wide, looks), few);
  }
}

// The baked color equals the worked example in docs/color.md.
TEST(BakeRegion, WorkedExample) {
  TestLooks looks;
  looks.materials.assign(1, Material{});
  looks.materials[0].factor = {32768, 65535, 65535, 65535};
  FixedSurface surface;
  surface.position = fixed({{{1, 1, 129}, {1023, 1, 129}, {1, 1023, 129}}});
  const Sums sums = bake_grid({2, 2}, 0, {surface}, looks);
  EXPECT_EQ(sums.size(), 13u);  // 10 cells, and 3 that only touch the longest edge at a corner
  EXPECT_EQ(sums.at({0, 0, 0}).weight, 1024u);
  EXPECT_EQ(color_of(sums.at({0, 0, 0})), (Color{{188, 255, 255}, 255}));
}

// Coordinates of positions and textures are at their limits. Sanitizers check that there is no
// undefined behavior.
TEST(BakeRegion, HostileCoordinates) {
  const TestLooks looks;
  const int64_t far = (int64_t{1} << 40) - 1;
  const ColorGrid grid{20, 4};
  oracle::Random random(11);
  oracle::Triangles triangles;
  for (int i = 0; i < 60; ++i) {
    oracle::Triangle t;
    for (auto& vertex : t)
      for (auto& x : vertex)
        x = random.coin() ? (random.coin() ? far : -far) : random.odd(-(1 << 29), 1 << 29);
    triangles.push_back(t);
  }
  auto surfaces = looks.surfaces(triangles, 9, int64_t{1} << 40);
  const Sums sums = bake_grid(grid, 0, surfaces, looks);
  EXPECT_GT(sums.size(), 100u);
  EXPECT_EQ(bake_grid(grid, 1, surfaces, looks), sums);
  for (const auto& [position, sum] : sums) {
    EXPECT_LE(sum.seen_weight, 255 * sum.weight);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_LE(sum.plain[c], 65535 * sum.weight);
      EXPECT_LE(sum.seen[c], 65535 * sum.seen_weight);
    }
  }
}

// Every compiler and every optimization level must give the same bits.
TEST(BakeRegion, GoldenDigest) {
  const TestLooks looks;
  uint64_t digest = 0, covered = 0;
  // Uses only the kinds of scenes that call the random generator in the same order with every
  // compiler.
  for (const SceneKind kind :
       {SceneKind::kDegenerate, SceneKind::kSliver, SceneKind::kWalls, SceneKind::kDiagonal,
        SceneKind::kSpanning, SceneKind::kThroughCorners, SceneKind::kCrossing, SceneKind::kWide})
    for (const ColorGrid grid : {ColorGrid{5, 5}, ColorGrid{9, 4}, ColorGrid{20, 3}}) {
      for (const auto& [at, sum] : bake_grid(grid, 0, scene(looks, kind, 2, grid, 60), looks)) {
        covered += sum.weight >= 64;
        const Color color = color_of(sum);
        for (const uint64_t word :
             {sum.seen[0], sum.seen[1], sum.seen[2], sum.plain[0], sum.plain[1], sum.plain[2],
              sum.weight, sum.seen_weight,
              uint64_t{color.rgb[0]} << 24 | color.rgb[1] << 16 | color.rgb[2] << 8 | color.alpha})
          digest = mix_bits(digest ^ word) + at[0];
      }
    }
  EXPECT_GT(covered, 10000u);
  EXPECT_EQ(digest, 10497593858233737049u);
}

}  // namespace
}  // namespace voxdag
