// Files with different color grids, limits of the color grid, and fill colors without effect.
#include <gmock/gmock.h>

#include "tests/support/error_of.h"
#include "tests/unit/query/combine/combine_colors_fixture.h"

namespace voxdag::query {
namespace {

using voxdag_reader::ColorCursor;
using voxdag_reader::ColorRegion;

// All attributes of the result have the grid of the finest cells, also if they come from different
// files.
TEST_F(CombineColors, AttributesShareOneGrid) {
  for (const auto& [color_a, color_b] : {std::pair{7u, 4u}, {4u, 7u}}) {
    write(7, color_a, 7, color_b);
    write_valued(path("a"), scenes_[0], {Attribute::kColor, Attribute::kAlpha});
    write_valued(path("b"), scenes_[1], {Attribute::kNormal});
    combine_files("a", "b", spec(Operation::kAnd, "c"));
    const auto file = open_global_file(path("c"));
    for (const Attribute attribute : {Attribute::kColor, Attribute::kAlpha, Attribute::kNormal})
      EXPECT_EQ(section_of(*file, attribute).color_levels(), 7u) << name_of(attribute);
    // The normals of a cell of level 7 are the normals of b's cell that contains it.
    const auto file_b = open_global_file(path("b"));
    ColorCursor found(*file, file->normals()), expected(*file_b, file_b->normals());
    for (const uint64_t code : result_voxels(spec(Operation::kAnd, "c"))) {
      const Position at = position_of(code);
      const uint32_t up = 7 - color_b;
      uint64_t i = 0, j = 0;
      const ColorRegion* const region = found.find(at[0], at[1], at[2], 7, i);
      const ColorRegion* const region_b =
          expected.find(at[0] >> up, at[1] >> up, at[2] >> up, color_b, j);
      ASSERT_TRUE(region && region_b);
      ASSERT_EQ(region->value(i), region_b->value(j));
    }
  }
}

// The file with large cells would need many more cells. The limit prevents this: the result then
// has the colors that the files store for cells of this size.
TEST_F(CombineColors, LimitedResolution) {
  write(8, 4, 8, 8);
  combine_files("a", "b", spec(Operation::kUnion, "c"));
  EXPECT_THAT(warnings_.texts,
              testing::ElementsAre("color cells of " + path("a") +
                                   " have an edge of 16 voxels, and color cells of the result of 1 "
                                   "voxel: the values of " +
                                   path("a") +
                                   " can take about 256 times as many bytes; --color-resolution 16 "
                                   "prevents this"));
  warnings_.texts.clear();
  for (const uint32_t levels : {4u, 6u}) {
    CombineSpec limited = spec(Operation::kUnion, "c");
    limited.color_resolution = uint64_t{1} << levels;
    combine_files("a", "b", limited);
    EXPECT_EQ(warnings_.texts.size(), levels == 4 ? 0u : 1u);
    const auto a = open_global_file(path("a")), b = open_global_file(path("b")),
               file = open_global_file(path("c"));
    EXPECT_EQ(file->colors().color_levels(), levels);
    ColorCursor found(*file, file->colors()), in_a(*a, a->colors()), in_b(*b, b->colors());
    std::set<uint64_t> cells_of_a;
    for (const uint64_t code : scenes_[0].voxels) cells_of_a.insert(code >> 3 * (8 - levels));
    const ColoredScene result{8, levels, result_voxels(limited), {}};
    for (const uint64_t code : result.cells(levels)) {
      const Position at = position_of(code);
      const bool is_from_a = cells_of_a.contains(code);
      const uint32_t up = is_from_a ? levels - 4 : 0;
      uint64_t i = 0, j = 0;
      const ColorRegion* const region = found.find(at[0], at[1], at[2], levels, i);
      const ColorRegion* const source =
          (is_from_a ? in_a : in_b)
              .find(at[0] >> up, at[1] >> up, at[2] >> up, is_from_a ? 4 : levels, j);
      ASSERT_TRUE(region && source);
      ASSERT_NEAR(region->color(i).r, source->color(j).r, kTolerance);
    }
  }
  const auto message = [&](uint64_t cells, std::optional<Position> offset) {
    CombineSpec wrong = spec(Operation::kUnion, "x");
    wrong.color_resolution = cells;
    wrong.offset = offset;
    const auto a = open_global_file(path("a")), b = open_global_file(path("b"));
    return error_of([&] { combine(*a, *b, wrong, system_files(), warnings_, never_); }).message();
  };
  for (const uint64_t cells : {2u, 48u, 512u})
    EXPECT_EQ(message(cells, std::nullopt), "--color-resolution " + std::to_string(cells) +
                                                ": expected a power of two from 4 to 256");
  write(8, 4, 4, 4);
  EXPECT_EQ(message(8, Position{}), "--color-resolution 8: a color cell would be larger than " +
                                        path("b") + ": expected at least 16");
  CombineSpec coarsest = spec(Operation::kUnion, "c");
  coarsest.color_resolution = 16;
  coarsest.offset = Position{5, 6, 7};
  combine_files("a", "b", coarsest);
}

TEST_F(CombineColors, WarnsOfAnUnusedFillColor) {
  write(6, 6, 6, 6);
  CombineSpec filled = spec(Operation::kUnion, "c");
  const auto expect_warning = [&](bool is_warned) {
    warnings_.texts.clear();
    filled.fill_color = {1, 2, 3};
    combine_files("a", "b", filled);
    EXPECT_EQ(warnings_.texts.size(), is_warned ? 1u : 0u);
    if (is_warned) {
      EXPECT_THAT(warnings_.texts[0], testing::StartsWith("--fill-color has no effect"));
    }
  };
  expect_warning(true);
  write_file(1, false);
  expect_warning(false);
  filled.operation = Operation::kMinus;
  expect_warning(true);
  filled.operation = Operation::kXor;
  filled.attributes = false;
  const Error error = error_of([&] { combine_files("a", "b", filled); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  EXPECT_THAT(error.message(), testing::HasSubstr("--fill-color and --no-attributes"));
}

}  // namespace
}  // namespace voxdag::query
