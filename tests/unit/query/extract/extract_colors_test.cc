// Compares the colors of an extract with the input's colors. Both are decoded by code written from
// docs/format.md.
#include <cmath>
#include <optional>

#include "tests/unit/core/format/color/colored_files.h"
#include "tests/unit/query/extract/extract_fixture.h"

namespace voxdag::query {
namespace {

using Color3 = SectionDecoder::Color3;

// linear_of() and stored_of() convert between a stored sRGB value, from 0 to 255, and linear light,
// from 0 to 1 (IEC 61966-2-1).
double linear_of(int stored) {
  const double s = stored / 255.0;
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}
double stored_of(double linear) {
  return 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055);
}

// Gives each cell one of two colors at random, so that a test notices if a cell has the color of
// another cell. Mixtures of the two colors are on a line in color space, which color blocks encode
// well.
constexpr int kTolerance = 40;  // the channels of the two colors differ by at least 120
SumOf two_colors() {
  return [](uint64_t code) {
    return oracle::Random(code).between(0, 1) ? sum_of_color(220, 180, 30, 1)
                                              : sum_of_color(40, 60, 200, 1);
  };
}

class ExtractColors : public Extract {
 protected:
  void write(uint32_t levels, uint32_t color_levels, const SumOf& sum_of = two_colors()) {
    scene_ = {levels, color_levels, random_codes(21, levels, 4000), sum_of};
    write_colored(path("in.vdag"), scene_);
  }

  static bool is_whole(const Selection& selection, uint32_t level, uint64_t code) {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    const int64_t edge = int64_t{1} << (selection.grid_levels - level);
    return selection.region.contains({x * edge, y * edge, z * edge}, edge);
  }

  // Returns the scene that the extract of `selection` contains. `cube` is the part of the input's
  // grid that becomes the extract's grid.
  ColoredScene part_of_scene(const Selection& selection, const Cube& cube) const {
    ColoredScene part;
    part.levels = selection.grid_levels - cube.level;
    const uint32_t finest = std::min(scene_.color_levels, selection.grid_levels);
    part.color_levels = std::max(finest, cube.level + 2) - cube.level;
    const uint64_t first = code_of(cube) << 3 * part.levels;
    for (const uint64_t code : scene_.cells(selection.grid_levels))
      if (is_whole(selection, selection.grid_levels, code)) part.voxels.push_back(code - first);
    return part;
  }
  static uint64_t code_of(const Cube& cube) {
    return morton_encode(cube.position[0], cube.position[1], cube.position[2]);
  }

  // Extracts the selection and checks the colors of all cells on all levels: cells that the region
  // does not cut have the input's color; other cells have the mean of their remaining finest cells.
  void check(const Selection& selection, bool crop) {
    const Cube cube = crop ? crop_cube(selection) : Cube{};
    const ColoredScene part = part_of_scene(selection, cube);
    extract_file("in.vdag", spec("out.vdag", selection, crop));
    if (part.voxels.empty()) {
      EXPECT_FALSE(open_global_file(path("out.vdag"))->has_colors());
      return;
    }
    const std::string in_bytes = bytes("in.vdag"), out_bytes = bytes("out.vdag");
    const SectionDecoder in(in_bytes, scene_), out(out_bytes, part);
    const auto stored = [&](uint32_t level, uint64_t code) {
      const uint32_t up = level - std::min(level, scene_.color_levels);
      return in.colors().at({level - up, code >> 3 * up});
    };
    const uint32_t finest = part.color_levels + cube.level;
    for (uint32_t level = cube.level; level <= finest; ++level) {
      // For each cell of the level: the sums of the linear colors of its finest cells in the
      // extract, and their number.
      std::map<uint64_t, std::array<double, 4>> means;
      for (const uint64_t code : part.cells(part.color_levels)) {
        const uint64_t whole_code = code_of(cube) << 3 * part.color_levels | code;
        auto& mean = means[whole_code >> 3 * (finest - level)];
        const Color3 color = stored(finest, whole_code);
        for (size_t c = 0; c < 3; ++c) mean[c] += linear_of(color[c]);
        mean[3] += 1;
      }
      for (const auto& [code, mean] : means) {
        const Color3 found = out.colors().at(
            {level - cube.level, code & ((uint64_t{1} << 3 * (level - cube.level)) - 1)});
        std::array<double, 3> expected;
        const bool is_stored = level == finest || is_whole(selection, level, code);
        for (size_t c = 0; c < 3; ++c)
          expected[c] = is_stored ? stored(level, code)[c] : stored_of(mean[c] / mean[3]);
        for (size_t c = 0; c < 3; ++c)
          ASSERT_NEAR(found[c], expected[c], kTolerance) << level << " " << code;
        cut_ += !is_stored;
        if (is_copied(selection, cube, finest, level, code)) {
          for (size_t c = 0; c < 3; ++c) ASSERT_EQ(found[c], expected[c]) << level << " " << code;
          ++copied_;
        }
      }
    }
  }

  // True if the cell is in a color region that the extract copies without encoding it again. Its
  // color must then be equal to the input's, not only near it.
  bool is_copied(const Selection& selection, const Cube& cube, uint32_t finest, uint32_t level,
                 uint64_t code) const {
    const uint32_t c = scene_.color_levels;
    if (finest > c) return false;
    const uint32_t tier = (c - level) / 7, part_tier = (finest - level) / 7;
    const uint32_t low = c - 7 * tier, part_low = finest - 7 * part_tier;
    const uint32_t high = low - std::min(low, 6u);
    const uint32_t part_high = part_low - std::min(part_low - cube.level, 6u);
    return low == part_low && high == part_high &&
           is_whole(selection, high, code >> 3 * (level - high));
  }

  ColoredScene scene_;
  size_t copied_ = 0, cut_ = 0;
};

TEST_F(ExtractColors, OfEverythingAreTheSameBytes) {
  for (const auto& [levels, color_levels] :
       {std::pair{9u, 9u}, {8u, 7u}, {7u, 6u}, {6u, 2u}, {16u, 15u}}) {
    SCOPED_TRACE(testing::Message() << levels << ", " << color_levels);
    write(levels, color_levels);
    extract_file("in.vdag", spec("out.vdag", {levels, whole_grid(levels)}));
    EXPECT_TRUE(bytes("out.vdag") == bytes("in.vdag"));
  }
}

TEST_F(ExtractColors, OfLevels) {
  write(9, 8);
  for (uint32_t level = 2; level <= 9; ++level) {
    SCOPED_TRACE(level);
    check({level, whole_grid(level)}, false);
  }
  EXPECT_GT(copied_, 1000u);
  EXPECT_EQ(cut_, 0u);
}

// Colors are right in extracts of boxes that cut cells and color regions, with the complete grid
// and cropped.
TEST_F(ExtractColors, OfRegions) {
  for (const auto& [levels, color_levels] : {std::pair{8u, 8u}, {9u, 7u}, {8u, 3u}}) {
    write(levels, color_levels);
    oracle::Random random(3);
    for (int i = 0; i < 8; ++i) {
      Selection selection{levels - static_cast<uint32_t>(i % 3), {}};
      const int64_t edge = int64_t{1} << selection.grid_levels;
      for (size_t axis = 0; axis < 3; ++axis) {
        selection.region.low[axis] = random.between(0, edge / 2 - 1);
        selection.region.high[axis] = i % 4 == 3
                                          ? selection.region.low[axis] + random.between(1, 20)
                                          : random.between(edge / 2 + 1, edge);
      }
      SCOPED_TRACE(testing::Message() << levels << ", " << color_levels << ", try " << i);
      check(selection, i % 2 == 1);
    }
  }
  EXPECT_GT(copied_, 1000u);
  EXPECT_GT(cut_, 100u);
}

// An octant of the grid consists of complete color regions, because the color grid ends at the
// finest level of a tier. So the extract of an octant has the bytes of a file that contains only
// this octant.
TEST_F(ExtractColors, OfAnAlignedCubeAreThoseOfItsScene) {
  for (const auto& [levels, color_levels] : {std::pair{9u, 7u}, {7u, 7u}}) {
    write(levels, color_levels, smooth_colors(color_levels, 20));
    const int64_t half = int64_t{1} << (levels - 1);
    for (int octant = 0; octant < 8; ++octant) {
      Region region;
      for (int axis = 0; axis < 3; ++axis) {
        region.low[static_cast<size_t>(axis)] = (octant >> (2 - axis) & 1) * half;
        region.high[static_cast<size_t>(axis)] = region.low[static_cast<size_t>(axis)] + half;
      }
      const Cube cube = crop_cube({levels, region});
      ASSERT_EQ(cube.level, 1u);
      ColoredScene part = part_of_scene({levels, region}, cube);
      ASSERT_FALSE(part.voxels.empty());
      const uint64_t first = static_cast<uint64_t>(octant) << 3 * part.color_levels;
      part.sum_of = [&](uint64_t code) { return scene_.sum_of(first | code); };
      Grid grid = Grid::given(
          {region.low[0] > 0 ? 0.5 : 0, region.low[1] > 0 ? 0.5 : 0, region.low[2] > 0 ? 0.5 : 0},
          0.5, part.levels);
      const oracle::Dag dag = sparse_dag(part.voxels, part.levels);
      GlobalFileWriter writer(system_files(), path("expected.vdag"), grid, 64);
      write_levels(writer, dag, part.levels);
      write_colors(writer, part);
      writer.finish({dag.voxels, dag.svo_nodes});
      extract_file("in.vdag", spec("out.vdag", {levels, region}, true));
      EXPECT_TRUE(bytes("out.vdag") == bytes("expected.vdag")) << octant;
    }
  }
}

TEST_F(ExtractColors, MemoryAndThreadsDoNotMatter) {
  write(9, 9, smooth_colors(9, 20));
  const Selection selection{9, {{3, 5, 100}, {500, 400, 490}}};
  ExtractSpec one = spec("one.vdag", selection), many = spec("many.vdag", selection);
  one.threads = 1;
  many.threads = 5;
  many.memory_bytes = uint64_t{1} << 30;
  extract_file("in.vdag", one);
  extract_file("in.vdag", many);
  EXPECT_TRUE(bytes("one.vdag") == bytes("many.vdag"));
}

TEST_F(ExtractColors, OfNothing) {
  scene_ = {8, 8, {0, 1, 2}, smooth_colors(8, 0)};
  write_colored(path("in.vdag"), scene_);
  check({8, {{100, 100, 100}, {200, 200, 200}}}, false);
  ASSERT_EQ(warnings_.texts.size(), 1u);
  EXPECT_EQ(open_global_file(path("out.vdag"))->version(), 1u);
}

// The extract reports damage in a color region that it copies, in a region that it encodes again,
// and in the directory of color regions.
TEST_F(ExtractColors, DamageIsFound) {
  write(8, 8);
  const std::string intact = bytes("in.vdag");
  std::vector<uint64_t> places;
  {
    const auto file = open_global_file(path("in.vdag"));
    const auto& tier = file->colors().tier(0);
    places = {static_cast<uint64_t>(tier.data - file->data()) + 8 * tier.units,
              static_cast<uint64_t>(tier.directory - file->data()) + 40};
  }
  for (const uint64_t place : places)
    for (const Region& region : {whole_grid(8), Region{{1, 1, 1}, {255, 255, 255}}}) {
      std::string damaged = intact;
      damaged[place] = static_cast<char>(damaged[place] ^ 4);
      write_bytes(path("in.vdag"), damaged);
      std::optional<ErrorCode> code;
      try {
        const auto file = open_global_file(path("in.vdag"));
        extract(*file, spec("out.vdag", {8, region}), system_files(), warnings_, never_);
      } catch (const Error& error) {
        code = error.code();
      }
      EXPECT_EQ(code, ErrorCode::kCorrupt);
      expect_files({"in.vdag"});
    }
}

}  // namespace
}  // namespace voxdag::query
