// Compares the vector code that bakes colors with plain code, and its divisions in doubles with
// divisions of integers.
#include <gtest/gtest.h>

#include "core/color/color_of.h"
#include "core/color/rule/add_weighted.h"
#include "core/color/rule/columns.h"
#include "tests/oracle/scenes.h"

namespace voxdag {
namespace {

TEST(ColorVectors, ColumnsAreThoseOfPlainCode) {
  oracle::Random random(1);
  uint32_t all = 0, none = ~0u;
  for (int i = 0; i < 50000; ++i) {
    const int64_t most = int64_t{1} << random.between(0, 59);
    const int64_t a = random.between(-most, most), b = random.between(-most, most);
    // In half of the rounds, the tested linear function is -1, 0 or 1 at one of the columns.
    const int64_t first = -a * random.between(0, 3) - b * random.between(0, 3) +
                          (random.coin() ? random.between(-1, 1) : random.between(-most, most));
    const uint32_t columns = color::negative_columns(first, a, b);
    ASSERT_EQ(columns, color::negative_columns_one_by_one(first, a, b)) << first << " " << a;
    ASSERT_EQ(columns, color::negative_columns<int128>(first, a, b));
    for (int k = 0; k < 16; ++k)
      ASSERT_EQ(columns >> k & 1, first + a * (k % 4) + b * (k / 4) < 0 ? 1u : 0u);
    all |= columns;
    none &= columns;
  }
  EXPECT_EQ(all, 0xffffu);
  EXPECT_EQ(none, 0u);
}

TEST(ColorVectors, TotalsOfEverySetOfColumns) {
  for (uint32_t columns = 0; columns <= color::kAllColumns; ++columns) {
    int64_t count = 0, sum_i = 0, sum_j = 0;
    for (int k = 0; k < 16; ++k) {
      if ((columns >> k & 1) == 0) continue;
      ++count;
      sum_i += k % 4;
      sum_j += k / 4;
    }
    const color::ColumnTotals totals = color::totals_of(columns);
    ASSERT_EQ(totals.count, count);
    ASSERT_EQ(totals.sum_i, sum_i);
    ASSERT_EQ(totals.sum_j, sum_j);
  }
}

TEST(ColorVectors, SumsAreThoseOfPlainCode) {
  oracle::Random random(2);
  ColorSum vectors, plain;
  for (int i = 0; i < 20000; ++i) {
    color::Texel texel = 0;
    for (int c = 0; c < 4; ++c)
      texel |= static_cast<uint64_t>(random.coin() ? 65535 : random.between(0, 65535)) << 16 * c;
    const auto weight = static_cast<uint64_t>(random.between(1, (1 << 24) - 1));
    const uint64_t seen = weight * static_cast<uint64_t>(random.between(0, 255));
    color::add_weighted(texel, weight, seen, vectors);
    color::add_weighted_one_by_one(texel, weight, seen, plain);
    ASSERT_EQ(vectors, plain);
  }
  ColorSum sum = plain;
  sum.add(vectors);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(sum.seen[c], 2 * plain.seen[c]);
    EXPECT_EQ(sum.plain[c], 2 * plain.plain[c]);
  }
  EXPECT_EQ(sum.weight, 2 * plain.weight);
  EXPECT_EQ(sum.seen_weight, 2 * plain.seen_weight);
}

// Returns the color by the definition: divides 128-bit integers, and counts the thresholds one by
// one.
Color plain_color(const ColorSum& sum) {
  const auto rounded = [](uint64_t numerator, uint64_t denominator) {
    return static_cast<uint64_t>((uint128{2} * numerator + denominator) /
                                 (uint128{2} * denominator));
  };
  constexpr color::SrgbThresholds kThresholds{};
  Color color;
  for (size_t c = 0; c < 3; ++c) {
    const uint64_t mean = sum.seen_weight != 0 ? rounded(sum.seen[c], sum.seen_weight)
                                               : rounded(sum.plain[c], sum.weight);
    color.rgb[c] = 0;
    for (int i = 0; i < 255; ++i) color.rgb[c] += kThresholds.of[i] <= mean;
  }
  color.alpha = static_cast<uint8_t>(rounded(sum.seen_weight, sum.weight));
  return color;
}

// The vector code gives the color of the definition for means at and next to every threshold,
// including exact halves, with small and large weights.
TEST(ColorVectors, StoredColorsAreThoseOfTheDefinition) {
  oracle::Random random(4);
  constexpr color::SrgbThresholds kThresholds{};
  size_t transparent = 0;
  for (int i = 0; i < 60000; ++i) {
    const int bits = static_cast<int>(random.between(0, i % 2 == 0 ? 12 : 39));
    ColorSum sum;
    sum.weight = static_cast<uint64_t>(random.between(1, int64_t{1} << bits)) * 2;
    const auto alpha = static_cast<uint64_t>(random.coin() ? 255 : random.between(0, 255));
    sum.seen_weight = sum.weight * alpha;
    for (size_t c = 0; c < 3; ++c) {
      const uint64_t threshold = kThresholds.of[random.between(0, 255)];
      // The mean is exactly half a unit below the threshold, or slightly less.
      const uint64_t twice = 2 * threshold - 1;
      const uint64_t less = random.coin() ? 1 : 0;
      sum.plain[c] = sum.weight / 2 * twice - less;
      sum.seen[c] = sum.seen_weight / 2 * twice - (sum.seen_weight == 0 ? 0 : less);
    }
    transparent += alpha == 0;
    ASSERT_EQ(color_of(sum), plain_color(sum)) << sum.weight << " " << alpha;
  }
  EXPECT_GT(transparent, 50u);
}

// The color of an opaque cell is that of the definition, for means at and next to every threshold.
TEST(ColorVectors, ColorsOfOpaqueCellsAreThoseOfTheDefinition) {
  oracle::Random random(6);
  constexpr color::SrgbThresholds kThresholds{};
  for (int i = 0; i < 60000; ++i) {
    const int bits = static_cast<int>(random.between(0, 15));
    ColorSum sum;
    sum.weight = static_cast<uint64_t>(random.between(1, int64_t{1} << bits)) * 2;
    sum.seen_weight = 255 * sum.weight;
    for (size_t c = 0; c < 3; ++c) {
      // The mean is half a unit below a threshold, or slightly less. It is 65535 for i = 0.
      const uint64_t twice = 2 * uint64_t{kThresholds.of[random.between(0, 255)]} - 1;
      sum.plain[c] = i == 0 ? 65535 * sum.weight
                            : sum.weight / 2 * twice - static_cast<uint64_t>(random.coin());
      sum.seen[c] = 255 * sum.plain[c];
    }
    ASSERT_EQ(opaque_color_of(sum.weight, sum.plain), plain_color(sum)) << sum.weight;
  }
}

}  // namespace
}  // namespace voxdag
