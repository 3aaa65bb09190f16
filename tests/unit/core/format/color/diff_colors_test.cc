// Compares diff_colors() with a comparison of all colors of both files, decoded by independent
// code.
#include "core/format/global/diff_colors.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/format/global/open_global.h"
#include "tests/unit/core/format/color/colored_files.h"

namespace voxdag {
namespace {

class DiffColors : public testing::Test {
 protected:
  std::string path(const char* name) const { return folder_.file(name); }
  ColorDiff diff(unsigned threads = 1) const {
    const auto a = open_global_file(path("a.vdag")), b = open_global_file(path("b.vdag"));
    return diff_colors(*a, *b, threads, CancelToken());
  }
  // Returns the expected differences, by brute force.
  ColorDiff expected(const ColoredScene& a, const ColoredScene& b) const {
    const ByteString bytes_a = read_bytes(path("a.vdag")), bytes_b = read_bytes(path("b.vdag"));
    const SectionDecoder in_a(bytes_a, a), in_b(bytes_b, b);
    ColorDiff diff{std::min(a.color_levels, b.color_levels)};
    for (const auto& [key, color] : in_a.colors()) {
      const auto other = in_b.colors().find(key);
      if (key.first != diff.levels || other == in_b.colors().end()) continue;
      ++diff.cells;
      diff.different_cells += color != other->second;
      for (size_t c = 0; c < 3; ++c) {
        const auto difference = static_cast<uint32_t>(std::abs(color[c] - other->second[c]));
        diff.largest = std::max(diff.largest, difference);
        diff.sum += difference;
        diff.squares += difference * difference;
      }
    }
    return diff;
  }
  void check(const ColoredScene& a, const ColoredScene& b) const {
    write_colored(path("a.vdag"), a);
    write_colored(path("b.vdag"), b);
    const ColorDiff right = expected(a, b);
    EXPECT_GT(right.different_cells, 0u);
    EXPECT_GE(right.cells, right.different_cells);
    for (const unsigned threads : {1u, 3u}) {
      const ColorDiff found = diff(threads);
      EXPECT_EQ(found.levels, right.levels);
      EXPECT_EQ(found.cells, right.cells);
      EXPECT_EQ(found.different_cells, right.different_cells);
      EXPECT_EQ(found.largest, right.largest);
      EXPECT_EQ(found.sum, right.sum);
      EXPECT_EQ(found.squares, right.squares);
      EXPECT_NEAR(found.mean(), static_cast<double>(right.sum) / (3.0 * double(right.cells)),
                  1e-12);
      EXPECT_NEAR(
          found.psnr(),
          20 * std::log10(255 / std::sqrt(double(right.squares) / (3.0 * double(right.cells)))),
          1e-9);
    }
  }

  TemporaryFolder folder_;
};

// Some cells have different colors. The largest difference is in one of these cells.
TEST_F(DiffColors, OfTheSameVoxels) {
  const ColoredScene a{9, 8, random_codes(1, 9, 3000), smooth_colors(8, 0)};
  ColoredScene b = a;
  b.sum_of = [&](uint64_t code) {
    return code % 7 == 0 ? sum_of_color(255, 0, 255, 1) : a.sum_of(code);
  };
  check(a, b);
}

TEST_F(DiffColors, OfOtherVoxels) {
  Codes voxels = random_codes(2, 8, 3000), others;
  for (size_t i = 0; i < voxels.size(); ++i)
    if (i % 3 != 0) others.push_back(voxels[i]);
  check({8, 8, voxels, smooth_colors(8, 3)}, {8, 8, others, smooth_colors(8, 3)});
}

// The files have different color grids. The comparison uses the cells of the coarser grid. The file
// with the finer grid has the colors of these cells in another tier (docs/format.md).
TEST_F(DiffColors, OfOtherColorGrids) {
  const Codes voxels = random_codes(3, 9, 3000);
  check({9, 9, voxels, smooth_colors(9, 0)}, {9, 2, voxels, smooth_colors(2, 0)});
}

TEST_F(DiffColors, OfEqualFiles) {
  const ColoredScene scene{9, 8, random_codes(4, 9, 3000), smooth_colors(8, 9)};
  write_colored(path("a.vdag"), scene);
  write_colored(path("b.vdag"), scene);
  const ColorDiff found = diff();
  EXPECT_EQ(found.levels, 8u);
  EXPECT_EQ(found.cells, scene.cells(8).size());
  EXPECT_EQ(found.different_cells, 0u);
  EXPECT_EQ(found.mean(), 0);
  EXPECT_TRUE(std::isinf(found.psnr()));
}

TEST_F(DiffColors, OfFilesWithoutColorsIsRefused) {
  const ColoredScene scene{6, 6, random_codes(5, 6, 300), smooth_colors(6, 9)};
  write_colored(path("a.vdag"), scene);
  write_colored(path("b.vdag"), scene, false);
  try {
    diff();
    FAIL() << "it was compared";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("b.vdag has no colors"), std::string::npos) << error.message();
  }
}

}  // namespace
}  // namespace voxdag
