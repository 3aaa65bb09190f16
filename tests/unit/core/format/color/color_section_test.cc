// Tests the color section. In every cell of every level, the colors of the reader and of the cursor
// equal the colors of a decoder written from docs/format.md, and are close to the original colors.
#include <gmock/gmock.h>

#include "core/color/color_of.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "tests/unit/core/format/color/colored_files.h"

namespace voxdag {
namespace {

using testing::HasSubstr;

std::array<int, 3> channels(const voxdag_reader::Rgb& rgb) { return {rgb.r, rgb.g, rgb.b}; }

class ColorSectionTest : public testing::Test {
 protected:
  // Compares all levels of a scene with the decoder. Returns the mean squared error of a channel
  // relative to the scene's sums.
  double check(const ColoredScene& scene, uint64_t narrow_words = uint64_t{1} << 32) {
    write_colored(path_, scene, true, narrow_words);
    const auto file = open_global_file(path_);
    EXPECT_EQ(file->version(), 2u);
    EXPECT_TRUE(file->has_colors());
    EXPECT_EQ(file->color_levels(), scene.color_levels);
    EXPECT_NO_THROW(verify(path_, narrow_words));
    const ByteString bytes = read_bytes(path_);
    const SectionDecoder decoder(bytes, scene);
    voxdag_reader::ColorCursor cursor(*file);
    std::map<uint64_t, ColorSum> sums;
    for (const uint64_t code : scene.cells(scene.color_levels)) sums[code] = scene.sum_of(code);
    double squares = 0, count = 0;
    uint64_t cells = 0;
    for (uint32_t level = scene.color_levels;; --level) {
      for (const auto& [code, sum] : sums) {
        uint32_t x, y, z;
        morton_decode(code, x, y, z);
        const auto found = cursor.color(x, y, z, level);
        const auto expected = decoder.colors().find({level, code});
        if (!found || expected == decoder.colors().end()) {
          ADD_FAILURE() << "level " << level << ", cell " << code << " has no color";
          return 0;
        }
        if (channels(*found) != expected->second ||
            (code % 16 == 0 && file->color(x, y, z, level) != found)) {
          ADD_FAILURE() << "level " << level << ", cell " << code;
          return 0;
        }
        const Color exact = color_of(sum);
        for (size_t c = 0; c < 3; ++c) {
          const double difference = channels(*found)[c] - exact.rgb[c];
          squares += difference * difference;
        }
        count += 3;
        ++cells;
      }
      if (level == 0) break;
      std::map<uint64_t, ColorSum> parents;
      for (const auto& [code, sum] : sums) parents[code >> 3].add(sum);
      sums = std::move(parents);
    }
    EXPECT_EQ(cells, decoder.colors().size());
    return squares / count;
  }

  static void verify(const std::string& path, uint64_t narrow_words = uint64_t{1} << 32) {
    MemoryBudget budget(uint64_t{1} << 30);
    NoProgress progress;
    verify_global_file(*open_global_file(path), 2, budget, progress, {}, narrow_words);
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("colored.vdag");
};

TEST_F(ColorSectionTest, HasTheColorsOfAllLevels) {
  // {levels of the grid, levels of the color grid}: grids from one brick to three tiers of colors
  // (docs/format.md), and color grids as fine as the grid or coarser.
  const uint32_t sizes[][2] = {{2, 2},   {3, 2},   {4, 4},   {5, 3},   {6, 6},   {7, 5},
                               {7, 6},   {7, 7},   {8, 7},   {9, 8},   {10, 10}, {12, 11},
                               {13, 12}, {14, 13}, {15, 14}, {17, 12}, {20, 20}};
  for (const auto& [levels, color_levels] : sizes) {
    SCOPED_TRACE(std::to_string(levels) + ", colors " + std::to_string(color_levels));
    const int count = levels < 4 ? 20 : 2000;
    const double error =
        check({levels, color_levels, random_codes(levels * 100 + color_levels, levels, count),
               smooth_colors(color_levels, 3)});
    // The error is larger than on surfaces, because cells that are far from each other share
    // blocks. If the colors were in a wrong order, the error would be about 10000.
    EXPECT_LT(error, levels < 4 ? 4000 : 2500);
  }
}

TEST_F(ColorSectionTest, HasSolidRegions) {
  Codes all(size_t{1} << 18);
  for (size_t i = 0; i < all.size(); ++i) all[i] = i;
  EXPECT_LT(check({6, 6, all, smooth_colors(6, 0)}), 20);
  Codes half;
  for (const uint64_t code : all) half.push_back(code + (code & 1 << 17 ? all.size() : 0));
  EXPECT_LT(check({7, 7, half, smooth_colors(7, 0)}), 20);
}

// If all cells have the same color, it is stored exactly on all levels.
TEST_F(ColorSectionTest, FlatColorsAreExact) {
  const auto flat = [](uint64_t) { return sum_of_color(13, 201, 77, 5); };
  EXPECT_EQ(check({9, 8, random_codes(5, 9, 3000), flat}), 0);
}

// The color sums of large scenes (10^10 cells or more) do not fit in 64 bits. A cell with a
// negligible weight keeps its color.
TEST_F(ColorSectionTest, LargeSumsDoNotOverflow) {
  constexpr int kDust = 170, kDark = 10, kBright = 250;
  const auto gray = [](int value, uint64_t weight) {
    return sum_of_color(value, value, value, weight);
  };
  for (const uint32_t levels : {8u, 15u}) {
    SCOPED_TRACE(levels);
    // There is one cell in each of 57 cubes of level 2. One cell is dust: it has a negligible
    // weight, and is the only cell in its octant. The others are dark or bright.
    Codes codes{0};
    for (uint64_t i = 8; i < 64; ++i) codes.push_back(i << 3 * (levels - 2));
    write_colored(path_, {levels, levels, codes, [&](uint64_t code) {
                            const bool bright = code >> (3 * levels - 1);
                            return code == 0 ? gray(kDust, 1)
                                             : gray(bright ? kBright : kDark, uint64_t{1} << 38);
                          }});
    verify(path_);
    const auto file = open_global_file(path_);
    const auto stored = [](const ColorSum& sum) { return color_of(sum).rgb[1]; };
    const int dust = stored(gray(kDust, 1)), dark = stored(gray(kDark, 1));
    const int bright = stored(gray(kBright, 1));
    ColorSum all = gray(kDark, 24);
    all.add(gray(kBright, 32));
    for (uint32_t level = 2; level <= levels; ++level)
      EXPECT_EQ(file->color(0, 0, 0, level)->g, dust) << level;
    const int half_step = (bright - dark + 13) / 14;  // half a step between the colors of a block
    EXPECT_NEAR(file->color(0, 0, 0, 1)->g, dust, half_step);
    EXPECT_NEAR(file->color(0, 0, 1, 1)->g, dark, half_step);
    EXPECT_NEAR(file->color(1, 1, 1, 1)->g, bright, half_step);
    EXPECT_NEAR(file->color(0, 0, 0, 0)->g, stored(all), half_step);
  }
}

TEST_F(ColorSectionTest, FinerCellsHaveTheColorOfTheirAncestor) {
  const ColoredScene scene{9, 5, random_codes(8, 9, 1000), smooth_colors(5, 20)};
  write_colored(path_, scene);
  const auto file = open_global_file(path_);
  voxdag_reader::ColorCursor cursor(*file);
  oracle::Random random(3);
  int set = 0;
  for (int i = 0; i < 20000; ++i) {
    const auto level = static_cast<uint32_t>(random.between(0, 9));
    const uint64_t near = scene.voxels[static_cast<size_t>(random.between(0, 999))];
    uint32_t at[3];
    morton_decode(near >> 3 * (9 - level), at[0], at[1], at[2]);
    at[i % 3] ^= static_cast<uint32_t>(random.between(0, 1));
    const auto color = cursor.color(at[0], at[1], at[2], level);
    EXPECT_EQ(color, file->color(at[0], at[1], at[2], level));
    const uint64_t code = morton_encode(at[0], at[1], at[2]), first = code << 3 * (9 - level);
    const auto voxel = std::lower_bound(scene.voxels.begin(), scene.voxels.end(), first);
    const bool there = voxel != scene.voxels.end() && *voxel >> 3 * (9 - level) == code;
    ASSERT_EQ(color.has_value(), there) << level << " " << code;
    set += there;
    if (!there || level <= 5) continue;
    EXPECT_EQ(color,
              file->color(at[0] >> (level - 5), at[1] >> (level - 5), at[2] >> (level - 5), 5));
  }
  EXPECT_GT(set, 1000);
  EXPECT_LT(set, 19000);
  EXPECT_FALSE(cursor.color(-1, 0, 0, 9));
  EXPECT_FALSE(cursor.color(0, 512, 0, 9));
  EXPECT_FALSE(cursor.color(0, 0, 1 << 10, 10));
}

// A file has version 1 if it needs no feature of version 2. The features are independent of each
// other.
TEST_F(ColorSectionTest, VersionsAndFeatures) {
  const ColoredScene scene{7, 6, random_codes(4, 7, 3000), smooth_colors(6, 4)};
  const std::string plain = folder_.file("plain.vdag");
  for (const bool wide : {false, true})
    for (const bool colored : {false, true}) {
      const uint64_t narrow_words = wide ? 50 : uint64_t{1} << 32;
      write_colored(plain, scene, colored, narrow_words);
      const auto file = open_global_file(plain);
      EXPECT_EQ(file->version(), wide || colored ? 2u : 1u);
      EXPECT_EQ(read_bytes(plain)[2176], (wide ? 1 : 0) + (colored ? 2 : 0));
      EXPECT_EQ(file->has_colors(), colored);
      EXPECT_EQ(file->level(5).pointer_bits, wide ? 64u : 32u);
      EXPECT_NO_THROW(file->verify_checksums());
      if (colored) check(scene, narrow_words);
    }
  write_colored(path_, scene, false);
  write_global(plain, sparse_dag(scene.voxels, 7), Grid::given({0, 0, 0}, 1, 7));
  EXPECT_EQ(read_bytes(path_), read_bytes(plain));
  EXPECT_FALSE(open_global_file(path_)->color(0, 0, 0, 0));
}

TEST_F(ColorSectionTest, AnUnfinishedSectionIsWrittenAgain) {
  const ColoredScene scene{8, 8, random_codes(6, 8, 5000), smooth_colors(8, 4)};
  const GlobalFileSummary whole = write_colored(folder_.file("whole.vdag"), scene);
  const oracle::Dag dag = sparse_dag(scene.voxels, 8);
  const Grid grid = Grid::given({0, 0, 0}, 1, 8);
  GlobalFileProgress progress;
  {
    GlobalFileWriter writer(system_files(), path_, grid, 64);
    write_levels(writer, dag, 8);
    progress = writer.progress();
    writer.sync();
    MemoryBudget budget(uint64_t{1} << 28);
    AttributeSectionWriter colors(writer, Attribute::kColor, 8, {}, budget);
    for (const EncodedRegion& region : encode_regions(scene)) colors.add_region(region);
  }
  GlobalFileWriter writer(system_files(), path_, grid, 64);
  writer.resume(progress);
  write_colors(writer, scene);
  EXPECT_EQ(writer.finish({dag.voxels, dag.svo_nodes}).sha256, whole.sha256);
}

TEST_F(ColorSectionTest, RegionsMustBeInOrderAndWhole) {
  const ColoredScene scene{8, 8, random_codes(6, 8, 5000), smooth_colors(8, 4)};
  const auto regions = encode_regions(scene);
  ASSERT_GT(regions.size(), 2u);
  const auto add = [&](std::vector<EncodedRegion> some, uint64_t bytes = uint64_t{1} << 28) {
    GlobalFileWriter writer(system_files(), path_, Grid::given({0, 0, 0}, 1, 8), 64);
    write_levels(writer, sparse_dag(scene.voxels, 8), 8);
    MemoryBudget budget(bytes);
    AttributeSectionWriter colors(writer, Attribute::kColor, 8, {}, budget);
    for (const EncodedRegion& region : some) colors.add_region(region);
    colors.finish();
  };
  EXPECT_NO_THROW(add(regions));
  EXPECT_THAT(error_of([&] {
                add({regions[1], regions[0]});
              }).message(),
              HasSubstr("above the previous region's, "));
  EXPECT_THAT(error_of([&] {
                add({regions[1], regions[1]});
              }).message(),
              HasSubstr("above the previous region's, "));
  EXPECT_THAT(error_of([&] { add({}); }).message(), HasSubstr("has no regions"));
  EncodedRegion wrong = regions[0];
  wrong.blocks.pop_back();
  EXPECT_THAT(error_of([&] { add({wrong}); }).message(), HasSubstr("bytes of blocks"));
  wrong = regions[0];
  wrong.counts[6] = 2;
  EXPECT_THAT(error_of([&] { add({wrong}); }).message(), HasSubstr("2 cells on level 2"));
  wrong = regions[0];
  wrong.morton = 64;
  EXPECT_EQ(error_of([&] { add({wrong}); }).code(), ErrorCode::kCorrupt);
  EXPECT_EQ(error_of([&] { add(regions, 1000); }).code(), ErrorCode::kOutOfMemory);
}

// Each byte of a section is changed, with and without corrected checksums. `verify` finds every
// change, except changes of color blocks with corrected checksums, which can be other valid colors.
// The reader never accesses memory outside the file; the address sanitizer checks this.
TEST_F(ColorSectionTest, DamageIsAnError) {
  const ColoredScene scene{3, 3, random_codes(2, 3, 60), smooth_colors(3, 60)};
  write_colored(path_, scene);
  const ByteString good = read_bytes(path_);
  uint64_t section, bytes;
  std::memcpy(&section, good.data() + 1152 + 8, 8);
  std::memcpy(&bytes, good.data() + 1152 + 16, 8);
  const std::string changed = folder_.file("changed.vdag");
  const auto blocks_end = section + encode_regions(scene)[0].blocks.size();
  int found = 0;
  for (uint64_t at = section; at < section + bytes; ++at)
    for (const int bit : {static_cast<int>(at % 8)}) {
      ByteString bad = good;
      bad[at] = static_cast<char>(bad[at] ^ 1 << bit);
      write_bytes(changed, bad);
      EXPECT_EQ(error_of([&] { verify(changed); }).code(), ErrorCode::kCorrupt) << at;
      put_checksums_right(bad);
      write_bytes(changed, bad);
      bool refused = false;
      try {
        verify(changed);
      } catch (const Error&) {
        refused = true;
      }
      EXPECT_TRUE(refused || at < blocks_end) << at - section;
      found += refused;
      try {
        const voxdag_reader::File file(changed);
        for (uint32_t level = 0; level <= 3; ++level)
          for (int cell = 0; cell < 1 << 3 * level; ++cell)
            file.color(cell >> 2 * level, cell >> level & ((1 << level) - 1),
                       cell & ((1 << level) - 1), level);
      } catch (const voxdag_reader::Error&) {
      }
    }
  EXPECT_GT(found, 50);
  for (uint64_t size = section; size < good.size(); size += 61) {
    write_bytes(changed, good.substr(0, size));
    EXPECT_THROW(voxdag_reader::File{changed}, voxdag_reader::Error);
  }
}

// A solid grid of 2^20 voxels per edge has one node per level and 8^14 color regions. This file has
// only one region. The reader must detect this before it counts all regions.
TEST_F(ColorSectionTest, MissingRegionsAreNotCounted) {
  constexpr uint32_t kLevels = 20;
  GlobalFileWriter writer(system_files(), path_, Grid::given({0, 0, 0}, 1, kLevels), 64);
  uint64_t nodes = 1, svo_nodes = 0;
  for (uint32_t level = kLevels - 1; level-- > 0; nodes *= 8) {
    const bool is_brick = level == kLevels - 2;
    const std::vector<uint32_t> words = is_brick
                                            ? std::vector<uint32_t>(2, ~0u)
                                            : std::vector<uint32_t>{255, 0, 0, 0, 0, 0, 0, 0, 0};
    writer.begin_level(level);
    writer.checksum_words(words);
    writer.write_words(0, words);
    writer.end_level({1, words.size()});
    svo_nodes += nodes;
  }
  ColoredCell cell;
  cell.sum = sum_of_color(1, 2, 3, 1);
  std::vector<ColoredCell> cells(size_t{1} << 18, cell);
  for (uint32_t code = 0; code < cells.size(); ++code) cells[code].code = code;
  MemoryBudget budget(uint64_t{64} << 20);
  AttributeSectionWriter section(writer, Attribute::kColor, kLevels, {}, budget);
  section.add_region(encode_region(6, 0, cells));
  section.finish();
  writer.finish({uint64_t{1} << 60, svo_nodes});
  EXPECT_THAT(error_of([&] { verify(path_); }).message(),
              HasSubstr(" regions: expected as many as the DAG has cells on level "));
}

TEST_F(ColorSectionTest, NothingIsNotColored) {
  GlobalFileWriter writer(system_files(), path_, Grid::given({0, 0, 0}, 1, 8), 64);
  MemoryBudget budget(uint64_t{1} << 20);
  EXPECT_EQ(
      error_of([&] { AttributeSectionWriter(writer, Attribute::kColor, 8, {}, budget); }).code(),
      ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace voxdag
