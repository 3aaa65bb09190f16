// Tests the cells of a region without the triangles that touch them.
#include "core/color/rule/region_cells.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/oracle/scenes.h"

namespace voxdag {
namespace {

// An encoder that collects the colors of RegionCells.
struct CollectedColors {
  std::map<uint32_t, Color> colors;  // only of cells that were not added as siblings
  size_t siblings = 0;
  void reserve(size_t) {}
  void add(std::span<const ColoredCell> cells, uint32_t first_code) {
    for (const ColoredCell& cell : cells) colors[first_code + cell.code] = color_of(cell.sum);
  }
  void add_siblings(uint32_t, std::span<const Color> cells, const ColorSum&) {
    siblings += cells.size();
  }
};

// Cells of one flat color reach the encoder without sums, unless the sums have overflowed. Then
// the color is that of the sums (docs/color.md).
TEST(RegionCells, FlatCellsHaveNoSums) {
  const FlatColor red{{65535, 0, 300}, 255}, blue{{0, 0, 65535}, 127};
  color::RegionCells cells;
  for (const uint32_t code : {0u, 5u, 9u, 17u, 26u}) cells.cover(code);
  const uint32_t first = cells.index_of(red), second = cells.index_of(blue);
  EXPECT_EQ(cells.index_of(red), first);
  EXPECT_NE(first, second);
  cells.add(0, red, first, 64);
  cells.add(1, red, first, 128);
  cells.add(2, blue, second, 64);  // alone in its parent
  cells.add(3, red, first, 64);    // a cell of two colors
  cells.add(3, blue, second, 64);
  const uint64_t huge = uint64_t{1} << 41;
  cells.add(4, red, first, huge);
  CollectedColors collected;
  cells.take(100, collected);
  EXPECT_EQ(collected.siblings, 3u);
  ColorSum both, overflowed;
  red.add_to(both, 64);
  blue.add_to(both, 64);
  red.add_to(overflowed, huge);
  EXPECT_EQ(collected.colors,
            (std::map<uint32_t, Color>{{117, color_of(both)}, {126, color_of(overflowed)}}));
}

// Returns a texel of random intensities and full alpha.
color::Texel random_texel(oracle::Random& random) {
  color::Texel texel = color::Texel{65535} << 48;
  for (int c = 0; c < 3; ++c)
    texel |= static_cast<color::Texel>(random.coin() ? 65535 : random.between(0, 65535)) << 16 * c;
  return texel;
}

// Cells of opaque, translucent and flat surfaces, in any order, have the sums that the surfaces
// have one by one. In some cells, the weight of opaque surfaces exceeds the limit of a CellWeight.
TEST(RegionCells, SumsAreThoseOfTheirSurfaces) {
  oracle::Random random(3);
  color::RegionCells cells;
  std::map<uint32_t, ColorSum> expected;
  const FlatColor flat{{9, 65535, 300}, 255};
  const uint32_t index = cells.index_of(flat);
  for (uint32_t code = 0; code < 400; ++code) {
    const uint32_t number = cells.cover(code);
    const int kinds = static_cast<int>(random.between(0, 2));
    const int64_t surfaces = random.coin() ? random.between(1, 4) : 150;
    for (int64_t i = 0; i < surfaces; ++i) {
      const auto weight = static_cast<uint64_t>(random.between(1, 1776));
      const int64_t kind = random.between(0, kinds);
      if (kind == 2) {
        cells.add(number, flat, index, weight);
        flat.add_to(expected[code], weight);
        continue;
      }
      const color::Texel texel = random_texel(random);
      const auto alpha = static_cast<uint32_t>(kind == 0 ? 255 : random.between(0, 254));
      cells.add(number, texel, alpha, weight);
      color::add_weighted_one_by_one(texel, weight, alpha * weight, expected[code]);
    }
  }
  std::vector<ColoredCell> taken;
  std::vector<CellValues> values;
  cells.take(taken, values);
  ASSERT_EQ(taken.size(), expected.size());
  uint64_t heaviest = 0;
  for (const ColoredCell& cell : taken) {
    ASSERT_EQ(cell.sum, expected[cell.code]) << cell.code;
    if (cell.sum.seen_weight == 255 * cell.sum.weight)
      heaviest = std::max(heaviest, cell.sum.weight);
  }
  EXPECT_GT(heaviest, color::CellWeight::kMaxOpaqueWeight);
}

// Opaque cells reach the encoder as siblings, with the colors and the sum of their ColorSums.
TEST(RegionCells, OpaqueCellsAreSiblings) {
  struct Encoder {
    std::vector<Color> colors;
    ColorSum sum;
    void reserve(size_t) {}
    void add(std::span<const ColoredCell>, uint32_t) { ADD_FAILURE(); }
    void add_siblings(uint32_t code, std::span<const Color> siblings, const ColorSum& total) {
      EXPECT_EQ(code, 1008u);
      colors.assign(siblings.begin(), siblings.end());
      sum = total;
    }
  } encoder;
  oracle::Random random(8);
  color::RegionCells cells;
  std::vector<Color> colors;
  ColorSum sum;
  for (const uint32_t code : {8u, 9u, 12u, 15u}) {
    ColorSum one;
    const uint32_t number = cells.cover(code);
    for (int i = 0; i < 5; ++i) {
      const color::Texel texel = random_texel(random);
      const auto weight = static_cast<uint64_t>(random.between(1, 1776));
      cells.add(number, texel, 255, weight);
      color::add_weighted(texel, weight, 255 * weight, one);
    }
    colors.push_back(color_of(one));
    sum.add(one);
  }
  cells.take(1000, encoder);
  EXPECT_EQ(encoder.colors, colors);
  EXPECT_EQ(encoder.sum, sum);
}

}  // namespace
}  // namespace voxdag
