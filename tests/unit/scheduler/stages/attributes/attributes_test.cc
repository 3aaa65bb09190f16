// Builds with alpha, normals and materials. Tests the values of the cells, and that all ways to
// build give the same bytes.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "query/verify/color_sample.h"
#include "scene/formats/formats.h"
#include "scheduler/plan_build.h"
#include "scheduler/run_build.h"
#include "scheduler/spec/build_fields.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/interruptions.h"
#include "tests/unit/scheduler/stages/attributes/painted_scene.h"

namespace voxdag {
namespace {

constexpr AttributeSet kAll = AttributeSet::all();

class Attributes : public testing::Test {
 protected:
  void SetUp() override { scene_ = PaintedScene::write(folder_.path()); }
  std::string output() const { return folder_.file("out.vdag"); }
  BuildSpec spec(uint64_t resolution, uint64_t color_resolution, const AttributeSet& set) const {
    BuildSpec spec = painted_spec(scene_, output(), resolution);
    spec.geometry.color_resolution = color_resolution;
    spec.geometry.attributes = set;
    return spec;
  }
  static BuildReport build(const BuildSpec& spec) { return build_now(spec); }
  query::ColorSampleReport compare_with_scene() const {
    const auto file = open_global_file(output());
    NoProgress progress;
    CancelToken cancel;
    MemoryBudget budget(uint64_t{256} << 20);
    verify_global_file(*file, 2, budget, progress, cancel);
    const auto scene = open_scene(system_files(), {scene_}, {}, budget, cancel);
    const double(&origin)[3] = file->origin();
    return query::compare_sampled_colors(
        *file, Grid::given({origin[0], origin[1], origin[2]}, file->edge(), file->grid_levels()),
        system_files(), *scene, 1, folder_.file("images"), 1, budget, progress, cancel);
  }
  // Returns the bytes of the section of this kind; "" if the file has none.
  static std::string section_of_kind(const std::string& path, uint32_t kind) {
    std::ifstream in(path, std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(in), {});
    for (size_t entry = 1152; entry < 1152 + 4 * 64; entry += 64) {
      uint32_t found;
      uint64_t offset, size;
      std::memcpy(&found, bytes.data() + entry, 4);
      std::memcpy(&offset, bytes.data() + entry + 8, 8);
      std::memcpy(&size, bytes.data() + entry + 16, 8);
      if (found == kind) return bytes.substr(offset, size);
    }
    return "";
  }

  TemporaryFolder folder_;
  std::string scene_;
};

TEST_F(Attributes, AreThoseOfTheScene) {
  const BuildReport report = build(spec(128, 64, kAll));
  ASSERT_TRUE(report.colors);
  const auto file = open_global_file(output());
  EXPECT_EQ(file->material_names(), (std::vector<std::string>{"sheet", "plain", ""}));
  voxdag_reader::ColorCursor cursor(*file, file->alphas());
  uint64_t cells = 0, sheet = 0, plain = 0;
  for (int64_t x = 0; x < 64; ++x)
    for (int64_t y = 0; y < 64; ++y)
      for (int64_t z = 0; z < 64; ++z) {
        uint64_t i;
        if (!cursor.find(x, y, z, 6, i)) continue;
        const auto material = file->material(x, y, z, 6);
        const auto normal = file->normal(x, y, z, 6);
        ASSERT_TRUE(material && normal && file->color(x, y, z, 6));
        EXPECT_EQ(file->alpha(x, y, z, 6), 255);
        ++cells;
        sheet += *material == 0;
        plain += *material == 1;
        // The front faces of both materials point down: the normals of material 1 exactly, and the
        // normals of the bumpy sheet at many angles.
        EXPECT_LT(normal->y, *material == 1 ? -0.999 : -0.1);
      }
  EXPECT_EQ(cells, report.colors->cells);
  EXPECT_GT(sheet, 1000u);
  EXPECT_GT(plain, 100u);
  EXPECT_EQ(sheet + plain, cells);
  const query::ColorSampleReport sample = compare_with_scene();
  EXPECT_EQ(sample.equal, sample.regions);
  EXPECT_GT(sample.cells, 1000u);
}

// The section of an attribute has the same bytes whichever other attributes the file has.
TEST_F(Attributes, AreIndependent) {
  build(spec(64, 64, kAll));
  std::string sections[5];
  for (uint32_t kind = 1; kind <= 4; ++kind) {
    sections[kind] = section_of_kind(output(), kind);
    EXPECT_GT(sections[kind].size(), 2000u);
  }
  for (const AttributeSet& set :
       {AttributeSet{Attribute::kColor}, AttributeSet{Attribute::kAlpha},
        AttributeSet{Attribute::kNormal}, AttributeSet{Attribute::kMaterial},
        AttributeSet{Attribute::kAlpha, Attribute::kMaterial}}) {
    std::filesystem::remove(output());
    const BuildReport report = build(spec(64, 64, set));
    EXPECT_EQ(report.colors->images, set.use_images() ? 1u : 0u);
    for (uint32_t kind = 1; kind <= 4; ++kind)
      EXPECT_EQ(section_of_kind(output(), kind),
                set.has(static_cast<Attribute>(kind)) ? sections[kind] : "");
    const query::ColorSampleReport sample = compare_with_scene();
    EXPECT_EQ(sample.equal, sample.regions);
  }
}

// Fixes the bytes of a file with all attributes. If this digest changes, the file format or the
// rule of an attribute needs a new version.
TEST_F(Attributes, HaveTheBytesThatTheyAlwaysHad) {
  EXPECT_EQ(build(spec(128, 32, kAll)).sha256,
            "16972932e21dc5dd85a4b0a56dac3cb61857cf9b9b21624c4952ade7de2a560a");
}

TEST_F(Attributes, AreTheSameBytesFromEveryRoute) {
  std::string expected;
  for (const unsigned threads : {1u, 2u, 8u}) {
    BuildSpec s = spec(256, 256, kAll);
    s.run.threads = threads;
    s.run.subvolume_edge = threads == 2 ? 64 : 256;
    s.run.memory_bytes = uint64_t{64} << (threads == 1 ? 20 : 22);
    const std::string sha256 = build(s).sha256;
    if (expected.empty()) expected = sha256;
    EXPECT_EQ(sha256, expected) << threads << " threads";
    std::filesystem::remove(output());
  }
  const auto stop = [&](const char* stage, uint64_t done) {
    build_until(spec(256, 256, kAll), stage, done);
    EXPECT_TRUE(std::filesystem::exists(output() + ".work"));
    const BuildReport report = build(spec(256, 256, kAll));
    EXPECT_EQ(report.sha256, expected) << stage;
    EXPECT_GE(report.colors->cubes_reused, done);
    std::filesystem::remove(output());
  };
  stop("color", 9);
  stop("material", 1);
}

// If the stored artifact of one attribute of a cube is truncated, the cube is baked again; all
// other cubes are reused.
TEST_F(Attributes, AHalfStoredCubeIsBakedAgain) {
  const std::string expected = build(spec(256, 256, kAll)).sha256;
  std::filesystem::remove(output());
  build_until(spec(256, 256, kAll), "write", 0);
  const std::string artifacts = output() + ".work/colors.vddurable";
  std::filesystem::resize_file(artifacts, std::filesystem::file_size(artifacts) - 1);
  const BuildReport report = build(spec(256, 256, kAll));
  EXPECT_EQ(report.sha256, expected);
  EXPECT_EQ(report.colors->cubes_reused + 1, report.colors->cubes);
}

// A finished file is not reused if the name of a material has changed, because the file contains
// the names.
TEST_F(Attributes, FollowTheNamesOfMaterials) {
  BuildSpec s = spec(32, 32, {Attribute::kMaterial});
  s.run.keep_work = true;
  const std::string before = build(s).sha256;
  EXPECT_EQ(build(s).sha256, before);
  std::ifstream in(scene_);
  std::string json(std::istreambuf_iterator<char>(in), {});
  json.replace(json.find("plain"), 5, "other");
  std::ofstream(scene_) << json;
  EXPECT_NE(build(s).sha256, before);
  EXPECT_EQ(open_global_file(output())->material_names()[1], "other");
}

// A build refuses the work folder of a build with other attributes, and the error names them.
TEST_F(Attributes, BelongToTheJob) {
  build_until(spec(128, 128, {Attribute::kColor}), "write", 0);
  const Error error = error_of([&] { build(spec(128, 128, kAll)); });
  EXPECT_NE(error.message().find("\"attributes\":[\"color\",\"alpha\",\"normal\",\"material\"]"),
            std::string::npos)
      << error.message();
}

TEST_F(Attributes, ArePlanned) {
  NoProgress progress;
  CancelToken cancel;
  const BuildSpec s = spec(512, 512, kAll);
  const Estimate estimate = plan_build(s, {system_files(), progress, cancel});
  const auto bytes = static_cast<double>(build(s).bytes);
  EXPECT_LE(estimate.file_bytes.low, bytes);
  EXPECT_GE(estimate.file_bytes.high, bytes);
}

TEST(AttributeList, IsParsed) {
  const Field field("attributes");
  AttributeSet set;
  EXPECT_TRUE(parse_text(field, "normal,alpha", set));
  EXPECT_EQ(set, (AttributeSet{Attribute::kAlpha, Attribute::kNormal}));
  for (const char* wrong : {"", "normals", "alpha,", "alpha normal"})
    EXPECT_FALSE(parse_text(field, wrong, set)) << wrong;
  EXPECT_EQ(expectation<AttributeSet>(field), "names out of color, alpha, normal, material");
}

}  // namespace
}  // namespace voxdag
