#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/format/color/attribute_section_writer.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "query/export/export.h"
#include "scene/generate/generate.h"
#include "scheduler/plan_build.h"
#include "scheduler/run_build.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/interruptions.h"
#include "tests/unit/scheduler/stages/attributes/painted_scene.h"

namespace voxdag {
namespace {

class ColorStage : public testing::Test {
 protected:
  void SetUp() override { scene_ = PaintedScene::write(folder_.path()); }
  std::string output() const { return folder_.path() + "/out.vdag"; }
  BuildSpec spec(uint64_t resolution, uint64_t color_resolution = 0) const {
    BuildSpec spec = painted_spec(scene_, output(), resolution);
    spec.geometry.color_resolution = color_resolution;
    return spec;
  }
  static BuildReport build(const BuildSpec& spec) { return build_now(spec); }
  static std::string refusal(const BuildSpec& spec) {
    try {
      build(spec);
    } catch (const Error& error) {
      return error.message();
    }
    return "";
  }

  TemporaryFolder folder_;
  std::string scene_;
};

struct Counts {
  uint64_t red = 0, blue = 0, green = 0, other = 0;
};

// Returns the numbers of red, blue and green cells of a level. Red or blue cells on the wrong side
// of the sheet count as other colors.
Counts count_colors(const voxdag_reader::File& file, uint32_t level) {
  Counts counts;
  voxdag_reader::ColorCursor cursor(file);
  const int64_t edge = int64_t{1} << level;
  for (int64_t x = 0; x < edge; ++x)
    for (int64_t y = 0; y < edge; ++y)
      for (int64_t z = 0; z < edge; ++z) {
        const auto color = cursor.color(x, y, z, level);
        if (!color) continue;
        // The image of the sheet is red at low x and blue at high x.
        if (*color == voxdag_reader::Rgb{255, 0, 0} && x <= edge / 2)
          ++counts.red;
        else if (*color == voxdag_reader::Rgb{0, 0, 255} && x >= edge / 2 - 1)
          ++counts.blue;
        else if (*color == voxdag_reader::Rgb{0, 255, 0})
          ++counts.green;
        else
          ++counts.other;
      }
  return counts;
}

TEST_F(ColorStage, AreThoseOfTheMaterials) {
  const BuildReport report = build(spec(128));
  ASSERT_TRUE(report.colors);
  EXPECT_EQ(report.colors->resolution, 128u);
  EXPECT_EQ(report.colors->cells, report.merge.voxels);
  EXPECT_EQ(report.colors->images, 1u);
  const auto file = open_global_file(output());
  ASSERT_TRUE(file->has_colors());
  EXPECT_EQ(file->color_levels(), 7u);
  const Counts counts = count_colors(*file, 7);
  EXPECT_EQ(counts.red + counts.blue + counts.green + counts.other, file->voxels());
  EXPECT_GT(counts.red, 4000u);
  EXPECT_GT(counts.blue, 4000u);
  EXPECT_GT(counts.green, 500u);
  // Few cells have other colors. Colors are stored in blocks of up to 32 cells and are interpolated
  // between two colors of the block. So only a block with cells of both halves of the image, or of
  // the sheet and the triangle, can have other colors.
  EXPECT_LT(counts.other, file->voxels() / 10);
  NoProgress progress;
  MemoryBudget budget(uint64_t{64} << 20);
  verify_global_file(*file, 1, budget, progress, CancelToken{});
}

TEST_F(ColorStage, AreTheSameBytesFromEveryRoute) {
  for (const uint64_t color_resolution : {256u, 4u}) {
    std::string expected;
    for (const unsigned threads : {1u, 2u, 8u})
      for (const uint64_t subvolume : {64u, 256u}) {
        BuildSpec s = spec(256, color_resolution);
        s.run.threads = threads;
        s.run.subvolume_edge = subvolume;
        s.run.memory_bytes = uint64_t{64} << (20 + threads);
        if (threads == 1) s.run.memory_bytes = uint64_t{64} << 20;
        const BuildReport report = build(s);
        if (expected.empty()) expected = report.sha256;
        EXPECT_EQ(report.sha256, expected) << threads << " threads, subvolumes of " << subvolume;
      }
  }
}

TEST_F(ColorStage, AreTheSameAfterAnInterruption) {
  const std::string expected = build(spec(256, 128)).sha256;
  std::filesystem::remove(output());
  for (const char* stage : {"images", "surfaces", "color", "write"}) {
    build_until(spec(256, 128), stage, 0);
    EXPECT_TRUE(std::filesystem::exists(output() + ".work"));
    EXPECT_EQ(build(spec(256, 128)).sha256, expected) << stage;
    EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
    std::filesystem::remove(output());
  }
}

// Exported PLY and npz files have the colors of the cells, in the order of the cells.
TEST_F(ColorStage, AreExported) {
  build(spec(64));
  const auto file = open_global_file(output());
  NoProgress progress;
  const auto export_as = [&](const char* format) {
    query::ExportRequest request;
    request.format = &query::export_format(format);
    request.selection = {6, query::whole_grid(6)};
    request.output = folder_.path() + "/voxels." + format;
    request.memory_bytes = uint64_t{256} << 20;
    query::export_dag(system_files(), *file, request, progress, CancelToken{});
    std::ifstream in(request.output, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const std::string ply = export_as("ply"), npz = export_as("npz");
  const size_t body = ply.find("end_header\n") + 11;
  ASSERT_NE(ply.find("property uchar red\nproperty uchar green\nproperty uchar blue\nend_header"),
            std::string::npos);
  ASSERT_EQ(ply.size() - body, 27 * file->voxels());
  std::string colors;
  for (size_t at = body; at < ply.size(); at += 27) {
    double position[3];
    std::memcpy(position, ply.data() + at, sizeof position);
    int64_t cell[3];
    for (int a = 0; a < 3; ++a)
      cell[a] = static_cast<int64_t>((position[a] - file->origin()[a]) / file->edge() * 64);
    const auto color = file->color(cell[0], cell[1], cell[2], 6);
    ASSERT_TRUE(color);
    const std::string written = ply.substr(at + 24, 3);
    EXPECT_EQ(written, (std::string{static_cast<char>(color->r), static_cast<char>(color->g),
                                    static_cast<char>(color->b)}));
    colors += written;
  }
  EXPECT_NE(npz.find("colors.npy"), std::string::npos);
  EXPECT_NE(npz.find(colors), std::string::npos);
}

TEST_F(ColorStage, FollowTheImage) {
  const std::string red = build(spec(64)).sha256;
  PaintedScene::write(folder_.path(), 128);
  EXPECT_NE(build(spec(64)).sha256, red);
  const auto file = open_global_file(output());
  // Without colors, a change of the image does not change the file.
  BuildSpec plain = spec(64);
  plain.geometry.attributes = {};
  const std::string gray = build(plain).sha256;
  PaintedScene::write(folder_.path(), 255);
  EXPECT_EQ(build(plain).sha256, gray);
  EXPECT_FALSE(open_global_file(output())->has_colors());
}

TEST_F(ColorStage, NeedNoMaterials) {
  GenerateOptions options;
  options.kind = SceneKind::kSpheres;
  options.triangles = 2000;
  scene_ = folder_.path() + "/spheres.glb";
  NoProgress progress;
  generate_scene(system_files(), scene_, options, progress, CancelToken{});
  build(spec(64));
  const auto file = open_global_file(output());
  ASSERT_TRUE(file->has_colors());
  EXPECT_EQ(file->color(0, 0, 0, 0), (voxdag_reader::Rgb{255, 255, 255}));
}

TEST_F(ColorStage, WithoutVoxelsAreNone) {
  BuildSpec s = spec(64);
  s.geometry.bounds = {{100, 100, 100, 1}};
  s.run.allow_empty = true;
  const BuildReport report = build(s);
  EXPECT_EQ(report.merge.voxels, 0u);
  EXPECT_FALSE(open_global_file(output())->has_colors());
}

TEST_F(ColorStage, RefusesOptionsThatDoNotFit) {
  EXPECT_EQ(refusal(spec(64, 128)),
            "'color_resolution': expected at most the resolution, 64, not 128");
  EXPECT_NE(refusal(spec(64, 48)).find("'color_resolution': expected a power of two from 4"),
            std::string::npos);
  BuildSpec s = spec(64, 32);
  s.geometry.attributes = {};
  EXPECT_EQ(refusal(s), "'color_resolution': expected color or attributes as well");
}

// A plan includes colors: their size in the file, and additional disk space.
TEST_F(ColorStage, ArePlanned) {
  const auto plan = [](const BuildSpec& spec) {
    NoProgress progress;
    CancelToken cancel;
    return plan_build(spec, {system_files(), progress, cancel});
  };
  for (const uint64_t color_resolution : {512u, 128u}) {
    BuildSpec s = spec(512, color_resolution);
    const BuildReport report = build(s);
    const Estimate estimate = plan(s);
    const auto file_bytes = static_cast<double>(report.bytes);
    EXPECT_LE(estimate.file_bytes.low, file_bytes);
    EXPECT_GE(estimate.file_bytes.high, file_bytes);
    s.geometry.attributes = {};
    s.geometry.color_resolution = 0;
    const Estimate plain = plan(s);
    const auto section_bytes = file_bytes - static_cast<double>(build(s).bytes);
    ASSERT_TRUE(estimate.colors && !plain.colors);
    EXPECT_LE(estimate.colors->file_bytes.low, section_bytes);
    EXPECT_GE(estimate.colors->file_bytes.high, section_bytes);
    EXPECT_LE(estimate.colors->cells.low, static_cast<double>(report.colors->cells));
    EXPECT_GE(estimate.colors->cells.high, static_cast<double>(report.colors->cells));
    EXPECT_GT(estimate.disk_bytes.likely, plain.disk_bytes.likely + 2 * section_bytes * 0.9);
    EXPECT_GT(estimate.colors->cpu_s.likely, 0);
    EXPECT_GT(estimate.cpu_s.likely, estimate.colors->cpu_s.likely);
  }
}

}  // namespace
}  // namespace voxdag
