// Tests palettes. Few colors are kept unchanged; many colors are replaced by the nearest of 255
// colors. The order of the colors does not matter.
#include "query/export/color/color_palette.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/base/error.h"

namespace voxdag::query {
namespace {

using voxdag_reader::Rgb;

constexpr uint64_t kMemory = 16 << 20;

std::vector<Rgb> some_colors(size_t count) {
  std::mt19937 random(11);
  std::vector<Rgb> colors;
  for (size_t i = 0; i < count; ++i) {
    // Most colors are similar browns; some are grays, and a few are saturated.
    const auto part = [&](unsigned low, unsigned range) {
      return static_cast<uint8_t>(low + random() % range);
    };
    const uint8_t gray = part(0, 256);
    colors.push_back(i % 8 == 0     ? Rgb{gray, gray, gray}
                     : i % 500 == 1 ? Rgb{255, 0, part(200, 50)}
                                    : Rgb{part(90, 60), part(60, 50), part(20, 40)});
  }
  return colors;
}

ColorPalette palette_of(const std::vector<Rgb>& colors, MemoryBudget& budget) {
  ColorPalette palette(budget);
  for (const Rgb color : colors) palette.add(color);
  palette.make();
  return palette;
}

double squared_distance(Rgb a, Rgb b) {
  return std::pow(a.r - b.r, 2) + std::pow(a.g - b.g, 2) + std::pow(a.b - b.b, 2);
}

TEST(ColorPalette, KeepsFewColors) {
  MemoryBudget budget(kMemory);
  std::vector<Rgb> colors;
  for (int i = 0; i < 255; ++i) colors.push_back({uint8_t(i), uint8_t(i / 2), 7});
  const ColorPalette palette = palette_of(colors, budget);
  EXPECT_EQ(palette.colors().size(), 255u);
  for (const Rgb color : colors) EXPECT_EQ(palette.colors()[palette.index_of(color)], color);
}

TEST(ColorPalette, IsNearManyColors) {
  MemoryBudget budget(kMemory);
  const std::vector<Rgb> colors = some_colors(50000);
  const ColorPalette palette = palette_of(colors, budget);
  ASSERT_EQ(palette.colors().size(), 255u);
  double squares = 0;
  for (const Rgb color : colors)
    squares += squared_distance(color, palette.colors()[palette.index_of(color)]);
  EXPECT_LT(squares / 3 / static_cast<double>(colors.size()), 16);
  // The palette also has a color near a rare color that is far from all others.
  const Rgb rare{255, 0, 220};
  EXPECT_LT(squared_distance(rare, palette.colors()[palette.index_of(rare)]), 300);
}

TEST(ColorPalette, DependsOnTheColorsOnly) {
  MemoryBudget budget(2 * kMemory);
  std::vector<Rgb> colors = some_colors(20000);
  const ColorPalette palette = palette_of(colors, budget);
  std::shuffle(colors.begin(), colors.end(), std::mt19937(1));
  EXPECT_EQ(palette_of(colors, budget).colors(), palette.colors());
  // The palette must be the same on every machine and with every compiler.
  uint32_t sum = 0;
  for (const Rgb color : palette.colors()) {
    sum = sum * 31 + color.r;
    sum = sum * 31 + color.g;
    sum = sum * 31 + color.b;
  }
  EXPECT_EQ(sum, 3111657675u);
}

TEST(ColorPalette, IsChargedToTheBudget) {
  MemoryBudget budget(1 << 20);
  EXPECT_THROW(ColorPalette{budget}, Error);
}

}  // namespace
}  // namespace voxdag::query
