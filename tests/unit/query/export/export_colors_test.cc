// In each format that stores colors, exported voxels have the colors that the reader returns. Tests
// complete files, regions and coarser levels.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <set>

#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "tests/unit/core/format/color/colored_files.h"
#include "tests/unit/query/export/color_decoders.h"
#include "tests/unit/query/export/corners.h"
#include "tests/unit/query/export/stages.h"

namespace voxdag::query {
namespace {

// Returns the colors of a scene with eight large patches, one color each. A palette can store all
// of them.
SumOf patches(uint32_t color_levels) {
  return [=](uint64_t code) {
    const uint64_t patch = code >> 3 * (color_levels - 1);
    return sum_of_color(static_cast<int>(patch * 36), 255 - static_cast<int>(patch * 20),
                        patch % 2 ? 200 : 10, 1);
  };
}

int linear16(int srgb) {
  const double s = srgb / 255.0;
  const double linear = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
  return static_cast<int>(std::lround(65535 * linear));
}

class ExportColors : public testing::Test {
 protected:
  static constexpr uint64_t kMemory = 64 << 20;

  void open(uint32_t levels, uint32_t color_levels, const SumOf& sum_of, uint64_t seed) {
    const std::string path = folder_.file("a.vdag");
    write_colored(path, {levels, color_levels, random_codes(seed, levels, 3000), sum_of});
    file_ = open_global_file(path);
  }

  // Exports, and returns the bytes of the written files.
  std::vector<std::string> bytes_of(const std::string& format, const Selection& selection,
                                    bool gray = false) {
    const ExportFormat& to = export_format(format);
    const std::string output = folder_.file(std::string("out") + (to.suffix ? to.suffix : ".x"));
    NoProgress progress;
    std::vector<std::string> bytes;
    const ExportReport report =
        export_dag(system_files(), *file_, {&to, selection, output, kMemory, gray, true}, progress,
                   CancelToken{});
    for (const std::string& written : report.files) bytes.push_back(read_bytes(written));
    return bytes;
  }

  // Returns the colors of the selected cells according to the reader.
  std::map<Cell3, Color3> expected(const Selection& selection) const {
    std::map<Cell3, Color3> cells;
    const auto& [low, high] = selection.region;
    for (int64_t x = low[0]; x < high[0]; ++x)
      for (int64_t y = low[1]; y < high[1]; ++y)
        for (int64_t z = low[2]; z < high[2]; ++z)
          if (const auto color = file_->color(x, y, z, selection.grid_levels))
            cells[{x, y, z}] = {color->r, color->g, color->b};
    EXPECT_GT(cells.size(), 200u) << "too small a scene";
    return cells;
  }

  // Calls check(selection) for selections of two files: a complete file, two regions, and a coarser
  // level. In the first file colors are as fine as voxels; in the second they are coarser.
  template <class Check>
  void for_each_case(const Check& check) {
    open(6, 6, smooth_colors(6, 20), 1);
    check(Selection{6, whole_grid(6)});
    check(Selection{6, {{5, 3, 17}, {61, 60, 50}}});
    open(7, 4, smooth_colors(4, 20), 2);
    check(Selection{7, {{0, 0, 0}, {128, 128, 64}}});
    check(Selection{5, whole_grid(5)});
  }

  TemporaryFolder folder_;
  std::unique_ptr<voxdag_reader::File> file_;
};

TEST_F(ExportColors, VoxKeepsFewColorsExactly) {
  open(6, 6, patches(6), 3);
  for (const Selection& selection :
       {Selection{6, whole_grid(6)}, Selection{6, {{5, 3, 17}, {61, 60, 50}}}}) {
    const auto cells = expected(selection);
    std::set<Color3> different;
    for (const auto& [cell, color] : cells) different.insert(color);
    ASSERT_LE(different.size(), 255u);
    ASSERT_GT(different.size(), 4u);
    EXPECT_EQ(decode_vox(bytes_of("vox", selection)[0], 64), cells);
  }
}

// If there are more than 255 colors, each voxel has a color of the palette that is near its own
// color.
TEST_F(ExportColors, VoxHasAPaletteOfManyColors) {
  for_each_case([&](const Selection& selection) {
    const auto cells = expected(selection);
    const auto decoded =
        decode_vox(bytes_of("vox", selection)[0], int64_t{1} << selection.grid_levels);
    ASSERT_EQ(decoded.size(), cells.size());
    double squares = 0;
    for (const auto& [cell, color] : cells) {
      ASSERT_TRUE(decoded.contains(cell));
      for (size_t c = 0; c < 3; ++c) squares += std::pow(decoded.at(cell)[c] - color[c], 2);
    }
    const double mean = squares / static_cast<double>(3 * cells.size());
    EXPECT_GT(10 * std::log10(255 * 255 / mean), 26);
  });
}

// HashDAG numbers colored voxels with 32 bits, so this export is refused, and the message names a
// level that fits. The selection is the complete grid, and its colors are coarser than its voxels.
TEST_F(ExportColors, HashDagNamesTheLevelThatFits) {
  constexpr uint32_t kLevels = 12;
  ColoredScene colors{2, 2, Codes(64), patches(2)};
  std::iota(colors.voxels.begin(), colors.voxels.end(), 0);
  GlobalFileWriter writer(system_files(), folder_.file("a.vdag"),
                          Grid::given({0, 0, 0}, 1, kLevels), 64);
  write_level(writer, kLevels - 2, 1, {~0u, ~0u});
  for (uint32_t level = kLevels - 2; level-- > 0;)
    write_level(writer, level, 1, {0xff, 0, 0, 0, 0, 0, 0, 0, 0});
  write_colors(writer, colors);
  writer.finish({uint64_t{1} << 3 * kLevels, 0});
  file_ = open_global_file(folder_.file("a.vdag"));
  const Error refused = error_of([&] { bytes_of("hashdag", {kLevels, whole_grid(kLevels)}); });
  EXPECT_EQ(refused.code(), ErrorCode::kLimit);
  EXPECT_TRUE(refused.message().ends_with(
      ": 68 719 476 736 voxels are selected, but HashDAG can store the colors of at most "
      "4 294 967 295 voxels (--gray leaves the colors out). --level 10 (1024 voxels per edge) "
      "fits, or take a smaller "
      "--region"))
      << refused.message();
  EXPECT_EQ(system_files().list(folder_.path()).size(), 1u) << "only the input is there";
}

// The stages of an export report the work for colors as progress.
TEST_F(ExportColors, ProgressIsReported) {
  open(6, 6, patches(6), 1);
  for (const ExportFormat& format : export_formats()) {
    SCOPED_TRACE(format.name);
    const std::string output =
        folder_.file(std::string("out") + (format.suffix ? format.suffix : ".x"));
    Stages stages;
    export_dag(system_files(), *file_, {&format, {6, whole_grid(6)}, output, kMemory, false, true},
               stages, CancelToken{});
    stages.expect_complete();
  }
}

// A model of a .vox file has at most 256 voxels per edge. So a larger grid is divided into cubes of
// 256 voxels per edge, and each cube that has voxels becomes a model.
TEST_F(ExportColors, VoxHasAModelForEachPlace) {
  open(9, 9, patches(9), 4);
  const auto decoded = decode_vox(bytes_of("vox", {9, whole_grid(9)})[0], 512);
  EXPECT_EQ(decoded.size(), file_->voxels());
  for (const auto& [cell, color] : decoded) {
    const auto stored = file_->color(cell[0], cell[1], cell[2], 9);
    ASSERT_TRUE(stored);
    ASSERT_EQ(color, (Color3{stored->r, stored->g, stored->b}));
  }
}

TEST_F(ExportColors, GlbHasLinearColorsOfFaces) {
  for_each_case([&](const Selection& selection) {
    const auto cells = expected(selection);
    size_t rectangles = 0;
    const auto faces = decode_glb(bytes_of("glb", selection)[0], selection.region.low, rectangles);
    std::map<std::pair<Cell3, int>, Color3> exposed;
    for (const auto& [cell, color] : cells)
      for (int direction = 0; direction < 6; ++direction) {
        Cell3 next = cell;
        next[static_cast<size_t>(direction / 2)] += direction % 2 ? -1 : 1;
        if (!cells.contains(next))
          exposed[{cell, direction}] = {linear16(color[0]), linear16(color[1]), linear16(color[2])};
      }
    EXPECT_TRUE(faces == exposed);
    EXPECT_LE(rectangles, exposed.size());
  });
}

// Adjacent faces of one color are merged into rectangles, like all adjacent faces in a file without
// colors.
TEST_F(ExportColors, GlbMergesFacesOfOneColor) {
  std::vector<uint64_t> sheet;
  for (uint32_t x = 0; x < 64; ++x)
    for (uint32_t z = 0; z < 64; ++z) sheet.push_back(morton_encode(x, 9, z));
  std::sort(sheet.begin(), sheet.end());
  const std::string path = folder_.file("sheet.vdag");
  write_colored(path, {6, 6, sheet, patches(6)});
  file_ = open_global_file(path);
  size_t rectangles = 0;
  decode_glb(bytes_of("glb", {6, whole_grid(6)})[0], {0, 0, 0}, rectangles);
  // The sheet has four patches. Each of its two large sides has a rectangle for each patch, and
  // each of its four narrow sides has two rectangles.
  EXPECT_EQ(rectangles, 16u);
}

TEST_F(ExportColors, HashDagHasThemInTheOrderOfItsVoxels) {
  for_each_case([&](const Selection& selection) {
    const auto cells = expected(selection);
    const auto files = bytes_of("hashdag", selection);
    ASSERT_EQ(files.size(), 2u);
    const HashDagColors colors(files[0], files[1]);
    EXPECT_EQ(colors.count(), cells.size());
    for (const auto& [cell, color] : cells) ASSERT_EQ(colors.color(cell), color);
  });
}

// An export of a full cube of 2^33 voxels is refused, because HashDAG numbers colors with 32 bits.
TEST_F(ExportColors, HashDagRefusesMoreThanItCanNumber) {
  const uint32_t levels = 11;
  const std::string path = folder_.file("full.vdag");
  GlobalFileWriter writer(system_files(), path, Grid::given({0, 0, 0}, 1, levels), 64);
  uint64_t svo_nodes = 0;
  for (uint32_t level = levels - 1; level-- > 0;) {
    const std::vector<uint32_t> words = level + 2 == levels
                                            ? std::vector<uint32_t>{~0u, ~0u}
                                            : std::vector<uint32_t>{255, 0, 0, 0, 0, 0, 0, 0, 0};
    writer.begin_level(level);
    writer.checksum_words(words);
    writer.write_words(0, words);
    writer.end_level({1, words.size()});
    svo_nodes += uint64_t{1} << 3 * level;
  }
  Codes all(64);
  std::iota(all.begin(), all.end(), 0);
  write_colors(writer, {2, 2, all, smooth_colors(2, 0)});
  writer.finish({uint64_t{1} << 3 * levels, svo_nodes});
  file_ = open_global_file(path);
  const Selection selection{levels, whole_grid(levels)};
  const auto error = error_of([&] { bytes_of("hashdag", selection); });
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  EXPECT_NE(error.message().find("8 589 934 592 voxels"), std::string::npos) << error.message();
  EXPECT_NE(error.message().find("--gray"), std::string::npos);
  EXPECT_EQ(bytes_of("hashdag", selection, true).size(), 2u);
}

// An export of a file whose colors or levels are damaged gives an Error or a file, and never
// crashes.
TEST_F(ExportColors, DamageIsAnErrorOrHarmless) {
  open(6, 6, smooth_colors(6, 20), 6);
  file_.reset();
  const std::string intact = read_bytes(folder_.file("a.vdag"));
  std::mt19937 random(3);
  int refused = 0;
  for (int round = 0; round < 45; ++round) {
    std::string damaged = intact;
    const size_t from = 4096 + random() % (intact.size() - 4096 - 64);
    for (size_t i = 0; i < 64; ++i) damaged[from + i] = static_cast<char>(random());
    write_bytes(folder_.file("a.vdag"), damaged);
    SCOPED_TRACE(testing::Message() << "64 bytes from byte " << from);
    try {
      file_ = open_global_file(folder_.file("a.vdag"));
      bytes_of(std::array{"vox", "glb", "hashdag"}[static_cast<size_t>(round) % 3],
               {6, whole_grid(6)});
    } catch (const Error&) {
      ++refused;
    }
    for (const DirectoryEntry& entry : system_files().list(folder_.path()))
      EXPECT_FALSE(entry.name.ends_with(".partial")) << entry.name;
  }
  EXPECT_GT(refused, 5);
}

// With --gray, a file with colors is exported like the same file without colors.
TEST_F(ExportColors, AreLeftOutOnRequest) {
  const ColoredScene scene{6, 6, random_codes(5, 6, 3000), smooth_colors(6, 20)};
  const Selection all{6, whole_grid(6)};
  for (const char* format : {"vox", "glb", "hashdag", "ply", "npz"}) {
    std::vector<std::vector<std::string>> written;
    for (const bool with_colors : {true, false}) {
      const std::string path = folder_.file("b.vdag");
      write_colored(path, scene, with_colors);
      file_ = open_global_file(path);
      written.push_back(bytes_of(format, all, with_colors));
    }
    EXPECT_EQ(written[0], written[1]) << format;
    write_colored(folder_.file("b.vdag"), scene);
    file_ = open_global_file(folder_.file("b.vdag"));
    EXPECT_NE(bytes_of(format, all), written[0]) << format;
  }
}

}  // namespace
}  // namespace voxdag::query
