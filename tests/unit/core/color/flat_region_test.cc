#include "core/color/rule/flat_region.h"

#include <gtest/gtest.h>

#include "core/color/blocks/region.h"
#include "tests/unit/core/color/looks.h"

namespace voxdag {
namespace {

using oracle::SceneKind;

// Indexes of the materials of TestLooks that have no image, by alpha mode.
constexpr uint32_t kOpaque = 2, kMask = 5, kBlend = 8;

// Returns surfaces of a scene that all have the same material and vertex color.
std::vector<FixedSurface> flat_scene(const TestLooks& looks, const ColorGrid& grid, SceneKind kind,
                                     int count, uint32_t material, uint16_t alpha) {
  const oracle::Region whole{{0, 0, 0}, 1 << grid.levels};
  auto surfaces = looks.surfaces(oracle::make_scene(kind, 13, whole, count), 1);
  for (FixedSurface& surface : surfaces) {
    surface.material = material;
    for (SurfaceCorner& corner : surface.corners) corner.color = {65535, 9999, 301, alpha};
  }
  return surfaces;
}

// The result is the same as from the sums of the single cells, in grids of one and of eight
// regions, and in grids that are smaller than a full region.
TEST(FlatRegion, IsEncodedLikeTheSumsOfItsCells) {
  const TestLooks looks;
  size_t cells = 0, regions = 0;
  for (const SceneKind kind : oracle::kAllKinds)
    for (const ColorGrid grid :
         {ColorGrid{8, 6}, ColorGrid{8, 7}, ColorGrid{5, 5}, ColorGrid{9, 3}, ColorGrid{20, 2}})
      for (const auto& [material, alpha] :
           {std::pair<uint32_t, uint16_t>{kOpaque, 65535}, {kMask, 1}, {kBlend, 40000}}) {
        SCOPED_TRACE(oracle::kind_name(kind) + " " + std::to_string(grid.levels) + " " +
                     std::to_string(grid.color_levels) + " " + std::to_string(material));
        const auto surfaces = flat_scene(looks, grid, kind, 100, material, alpha);
        const auto color = only_color_of(surfaces, looks.materials, nullptr);
        ASSERT_TRUE(color);
        FlatRegion flat(grid);
        RegionBaker<const TestImages> baker(grid, looks.materials, looks.images);
        const uint32_t level = grid.region_level(), levels = grid.color_levels - level;
        for (uint64_t morton = 0; morton < uint64_t{1} << 3 * level; ++morton) {
          Cube region{level, {}};
          morton_decode(morton, region.position[0], region.position[1], region.position[2]);
          RegionEncoder by_sums(levels);
          baker.begin(region);
          baker.add(surfaces);
          baker.finish(0, by_sums);
          ASSERT_TRUE(flat.find(region, surfaces));
          if (by_sums.empty()) {
            EXPECT_EQ(flat.weight(), 0u);
            continue;
          }
          const EncodedRegion a = by_sums.finish(morton);
          const EncodedRegion b =
              encode_flat_region(levels, morton, flat.cells(), *color, flat.weight());
          EXPECT_EQ(a.morton, b.morton);
          EXPECT_EQ(a.counts, b.counts);
          EXPECT_EQ(a.blocks, b.blocks);
          EXPECT_EQ(a.prefix, b.prefix);
          EXPECT_EQ(a.total, b.total);
          cells += a.counts[0];
          ++regions;
        }
      }
  EXPECT_GT(cells, 100000u);
  EXPECT_GT(regions, 300u);
}

// Regions with too many surfaces in uncovered cells are refused. The next region is not affected.
TEST(FlatRegion, RefusesTooManyUncoveredSurfaces) {
  const TestLooks looks;
  const ColorGrid grid{10, 2};
  oracle::Random random(5);
  oracle::Triangles triangles;
  for (int i = 0; i < 40000; ++i) {
    const int64_t at = random.odd(1, 1 << 18);
    triangles.push_back({{{at, 3, 5}, {at | 2, 7, 5}, {at, 3, 9}}});  // covers no column
  }
  const std::vector<FixedSurface> many = looks.surfaces(triangles, 1);
  const auto few = std::span(many).first(30000);
  FlatRegion flat(grid);
  EXPECT_FALSE(flat.find(Cube{}, many));
  ASSERT_TRUE(flat.find(Cube{}, few));
  EXPECT_EQ(flat.weight(), 30000u);
  EXPECT_EQ(popcount64(flat.cells()[0]), 4);
  EXPECT_FALSE(flat.find(Cube{}, many));
  EXPECT_TRUE(flat.find(Cube{}, {}));
  EXPECT_EQ(flat.weight(), 0u);
  // A triangle that covers the cells' columns makes the others ineffective.
  std::vector<FixedSurface> covered = many;
  covered.front().position = fixed({{{1, 1, 7}, {1 << 19, 1, 7}, {1, 1 << 19, 7}}});
  ASSERT_TRUE(flat.find(Cube{}, covered));
  EXPECT_EQ(flat.weight() % 64, 0u);
}

// Surfaces have only one color if none has an image, corners of different colors, or parts that can
// be cut out.
TEST(FlatRegion, OnlyColor) {
  TestLooks looks;
  const auto colors_of = [&](const std::vector<FixedSurface>& surfaces, const Cutouts* cutouts) {
    return only_color_of(surfaces, looks.materials, cutouts);
  };
  FixedSurface white;
  white.material = kOpaque;
  looks.materials[kOpaque].factor = {65535, 65535, 65535, 65535};
  looks.materials[kMask].factor = {20000, 65535, 65535, 65535};
  const FlatColor all{{65535, 65535, 65535}, 255}, some{{20000, 65535, 65535}, 255};
  EXPECT_EQ(colors_of({}, nullptr), std::nullopt);
  EXPECT_EQ(colors_of({white, white}, nullptr), all);
  FixedSurface masked = white;
  masked.material = kMask;
  EXPECT_EQ(colors_of({masked}, nullptr), some);
  EXPECT_EQ(colors_of({white, masked}, nullptr), std::nullopt);
  FixedSurface red = white;  // the same color by its vertices
  for (SurfaceCorner& corner : red.corners) corner.color[0] = 20000;
  EXPECT_EQ(colors_of({red, masked}, nullptr), some);
  FixedSurface mixed = white;
  mixed.corners[2].color[1] = 0;
  EXPECT_EQ(colors_of({mixed}, nullptr), std::nullopt);
  FixedSurface image = white;
  image.material = 0;
  EXPECT_EQ(colors_of({white, image}, nullptr), std::nullopt);
  Cutouts cutouts;
  cutouts.materials = looks.materials;
  EXPECT_EQ(colors_of({white}, &cutouts), all);
  EXPECT_EQ(colors_of({masked}, &cutouts), std::nullopt);
}

}  // namespace
}  // namespace voxdag
