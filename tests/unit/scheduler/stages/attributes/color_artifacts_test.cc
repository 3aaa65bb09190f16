// Tests which cubes of the color grid a later run of a build reuses, and which cubes it bakes
// again.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "scheduler/run_build.h"
#include "scheduler/stages/attributes/color_keys.h"
#include "scheduler/stages/attributes/region_record.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/interruptions.h"
#include "tests/unit/scheduler/slurm/played_slurm.h"
#include "tests/unit/scheduler/stages/attributes/painted_scene.h"

namespace voxdag {
namespace {

// A painted scene whose color grid consists of 64 cubes, about a third of which have surfaces.
class ColorArtifacts : public testing::Test {
 protected:
  void SetUp() override {
    scene_ = PaintedScene::write(folder_.path());
    expected_ = build(spec()).sha256;
    std::filesystem::remove(output());
  }
  std::string output() const { return folder_.file("out.vdag"); }
  std::string artifacts() const { return output() + ".work/colors.vddurable"; }
  BuildSpec spec() const { return painted_spec(scene_, output(), 256); }
  BuildReport build(const BuildSpec& spec) {
    CancelToken cancel;
    return run_build(spec, {system_files(), warnings_, cancel});
  }
  // Runs a build until all its colors are baked.
  void bake() { build_until(spec(), "write", 0); }
  BuildReport resume() {
    const BuildReport report = build(spec());
    EXPECT_EQ(report.sha256, expected_);
    EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
    std::filesystem::remove(output());
    return report;
  }
  // Adds one to the byte at this offset of the file with the stored cubes.
  void damage(uint64_t offset) {
    std::fstream file(artifacts(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(static_cast<std::streamoff>(offset));
    const char byte = static_cast<char>(file.get() + 1);
    file.seekp(static_cast<std::streamoff>(offset));
    file.put(byte);
  }

  TemporaryFolder folder_;
  std::string scene_, expected_;
  Warnings warnings_;
};

TEST_F(ColorArtifacts, AStopLosesTheCubesInWork) {
  for (const uint64_t done : {0u, 1u, 9u}) {
    build_until(spec(), "color", done);
    const BuildReport report = resume();
    EXPECT_GE(report.colors->cubes_reused, done);
    EXPECT_LE(report.colors->cubes_reused, done + spec().run.threads);
    EXPECT_GT(report.colors->cubes, 12u);
    EXPECT_GT(report.colors->image_bytes, 64u * 32 * 8);
  }
  EXPECT_EQ(warnings_.text, "");
}

TEST_F(ColorArtifacts, WithoutAnythingToBakeNoImageIsDecoded) {
  bake();
  const BuildReport report = resume();
  EXPECT_EQ(report.colors->cubes_reused, report.colors->cubes);
  EXPECT_EQ(report.colors->images, 1u);
  EXPECT_EQ(report.colors->image_bytes, 0u);
}

// If the image file changes, but not the glTF file, only the cubes that show the image are baked
// again.
TEST_F(ColorArtifacts, AChangedImageRepeatsTheCubesThatShowIt) {
  PaintedScene::write(folder_.path(), 128);
  const std::string changed = build(spec()).sha256;
  ASSERT_NE(changed, expected_);
  std::filesystem::remove(output());
  PaintedScene::write(folder_.path());
  bake();
  PaintedScene::write(folder_.path(), 128);
  expected_ = changed;
  const ColorReport colors = *resume().colors;
  // The cubes that show only the triangle, which is far from the sheet, are reused.
  EXPECT_GE(colors.cubes_reused, 4u);
  EXPECT_LE(colors.cubes_reused + 16, colors.cubes);
}

// A finished file is reused as long as its image is unchanged. After a change of the image, it is
// built again.
TEST_F(ColorArtifacts, AFinishedBuildIsOfItsImage) {
  BuildSpec s = spec();
  s.run.keep_work = true;
  const ColorReport colors = *build(s).colors;
  const BuildReport published = build(s);
  EXPECT_EQ(published.sha256, expected_);
  ASSERT_TRUE(published.colors);
  EXPECT_EQ(published.colors->resolution, 256u);
  EXPECT_EQ(published.colors->cells, colors.cells);
  EXPECT_EQ(published.colors->images, 1u);
  EXPECT_EQ(published.colors->cubes, colors.cubes);
  EXPECT_EQ(published.colors->cubes_reused, colors.cubes);
  PaintedScene::write(folder_.path(), 128);
  const BuildReport changed = build(s);
  EXPECT_NE(changed.sha256, expected_);
  EXPECT_GT(changed.colors->cubes_reused, 0u);
  std::filesystem::remove_all(output() + ".work");
  EXPECT_EQ(build(spec()).sha256, changed.sha256);
}

TEST_F(ColorArtifacts, WhatIsDamagedIsBakedAgain) {
  bake();
  damage(100);
  ColorReport colors = *resume().colors;
  EXPECT_EQ(colors.cubes_reused + 1, colors.cubes);
  EXPECT_NE(warnings_.text.find("damaged colors are baked again; number of cubes: 1"),
            std::string::npos);
  // A truncated file, as a killed process leaves it, gives no warning: only the last cube is baked
  // again.
  warnings_.text.clear();
  bake();
  std::filesystem::resize_file(artifacts(), std::filesystem::file_size(artifacts()) - 1);
  colors = *resume().colors;
  EXPECT_EQ(colors.cubes_reused + 1, colors.cubes);
  // Damages the header of the first cube. All later cubes are lost with it, because their positions
  // are unknown.
  bake();
  damage(20);
  EXPECT_EQ(resume().colors->cubes_reused, 0u);
  EXPECT_EQ(warnings_.text, "");
}

// Stored cubes of earlier scenes are dropped when they outnumber the cubes of this scene.
TEST_F(ColorArtifacts, DoNotGrowWithoutEnd) {
  BuildSpec s = spec();
  s.run.keep_work = true;
  build(s);
  const uint64_t one = std::filesystem::file_size(artifacts());
  for (int red = 10; red <= 80; red += 10) {
    PaintedScene::write(folder_.path(), static_cast<uint8_t>(red));
    build(s);
    EXPECT_LE(std::filesystem::file_size(artifacts()), 3 * one + (64 << 10)) << red;
  }
  EXPECT_GT(one, 64u << 10);
  EXPECT_EQ(warnings_.text, "");
}

TEST_F(ColorArtifacts, ARestartBakesAll) {
  bake();
  BuildSpec s = spec();
  s.run.restart = true;
  const BuildReport report = build(s);
  EXPECT_EQ(report.sha256, expected_);
  EXPECT_EQ(report.colors->cubes_reused, 0u);
}

TEST(ColorKeys, NameAllThatColorsDependOn) {
  const Material plain;
  const std::vector<std::string> images = {"image", "other"};
  const auto look = [&](const Material& material) {
    return look_digests(std::span(&material, 1), images, {Attribute::kColor})[0];
  };
  std::vector<Material> materials(8, plain);
  materials[1].factor[2] = 7;
  materials[2].alpha_mode = AlphaMode::kMask;
  materials[3].alpha_cutoff = 9;
  materials[4].wrap[1] = Wrap::kClampToEdge;
  materials[5].image = 0;
  materials[6].image = 1;
  materials[7].wrap[0] = Wrap::kClampToEdge;
  for (size_t i = 0; i < materials.size(); ++i)
    for (size_t k = 0; k < i; ++k) EXPECT_NE(look(materials[i]), look(materials[k])) << i << k;
  Material named = plain;
  named.name = "name";
  named.number = 9;
  EXPECT_EQ(look(named), look(plain));
  // The name and the number of a material affect its digest only if the file stores materials.
  const AttributeSet with_materials{Attribute::kMaterial};
  EXPECT_NE(look_digests(std::span(&named, 1), images, with_materials)[0],
            look_digests(std::span(&plain, 1), images, with_materials)[0]);

  const Cube cube{1, {0, 1, 0}};
  const BinContent content{3, {4, 5}, {}};
  const auto color_key = [](const ColorGrid& grid, const Cube& of, const BinContent& with) {
    return attribute_key({}, grid, of, with);
  };
  const Checksum128 key = color_key({9, 8}, cube, content);
  EXPECT_NE(color_key({9, 7}, cube, content), key);
  EXPECT_NE(color_key({10, 8}, cube, content), key);
  EXPECT_NE(color_key({9, 8}, Cube{1, {1, 0, 0}}, content), key);
  EXPECT_NE(color_key({9, 8}, cube, {2, {4, 5}, {}}), key);
  EXPECT_NE(color_key({9, 8}, cube, {3, {4, 6}, {}}), key);
  EXPECT_EQ(color_key({9, 8}, cube, {3, {4, 5}, ImageClasses(1)}), key);
  const auto alpha = attribute_key({Attribute::kAlpha, 1}, {9, 8}, cube, content);
  const auto narrow = attribute_key({Attribute::kMaterial, 1}, {9, 8}, cube, content);
  const auto wide = attribute_key({Attribute::kMaterial, 2}, {9, 8}, cube, content);
  EXPECT_TRUE(alpha != key && narrow != key && narrow != alpha && wide != narrow);
}

TEST(RegionRecords, ComeBackAsTheyWere) {
  EncodedRegion region;
  region.morton = uint64_t{1} << 40;
  region.counts = {700, 80, 9, 4, 3, 2, 1};
  region.blocks.assign(17, std::byte{5});
  region.prefix = {5, uint32_t{1} << 31};
  region.total = {{1, 2, uint64_t{1} << 50}, 3, {4, 5, 6}, 7};
  std::vector<std::byte> bytes;
  append_region(region, bytes);
  append_region({}, bytes);
  const std::string path = "color.artifacts";
  RegionRecords records(path, bytes);
  const auto first = records.next();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->morton, region.morton);
  EXPECT_EQ(first->counts, region.counts);
  EXPECT_EQ(first->blocks, region.blocks);
  EXPECT_EQ(first->prefix, region.prefix);
  EXPECT_EQ(first->total, region.total);
  EXPECT_TRUE(records.next());
  EXPECT_FALSE(records.next());
  bytes.pop_back();
  RegionRecords cut(path, bytes);
  EXPECT_TRUE(cut.next());
  try {
    cut.next();
    FAIL() << "expected an error";
  } catch (const Error& e) {
    EXPECT_TRUE(std::string(e.what()).starts_with(path)) << e.what();
  }
}

// Builds with colors on a cluster. The merge bakes the colors.
class ColorsOnCluster : public Cluster {
 protected:
  void SetUp() override {
    painted_ = PaintedScene::write(folder_.path());
    expected_ = run_build(colored(local_spec()), context()).sha256;
  }
  BuildSpec colored(BuildSpec spec) const {
    spec.geometry.scenes = {painted_};
    spec.geometry.resolution = 256;
    spec.geometry.attributes.add(Attribute::kColor);
    spec.run.threads = 2;
    return spec;
  }
  std::string painted_;
};

TEST_F(ColorsOnCluster, AreTheSameBytes) {
  for (const uint64_t tasks : {1, 3, 8}) {
    const BuildReport report = build(colored(spec(tasks)));
    ASSERT_TRUE(report.colors && report.cluster);
    EXPECT_EQ(report.cluster->batches, tasks);
    EXPECT_GT(report.colors->cells, 10000u);
  }
}

TEST_F(ColorsOnCluster, AMergeJobAnswersForItsImage) {
  slurm_.merge_job = [&] {
    BuildSpec job = colored(spec(3));
    job.run.cluster->is_merge_job = true;
    run_build(job, context());
  };
  BuildSpec merging = colored(spec(3));
  merging.run.cluster->merge_job = {.arguments = {"build"}, .folder = "/", .submit_options = {}};
  EXPECT_EQ(build(merging).sha256, expected_);
  PaintedScene::write(folder_.path(), 128);
  EXPECT_NE(run_build(merging, context()).sha256, expected_);
}

}  // namespace
}  // namespace voxdag
