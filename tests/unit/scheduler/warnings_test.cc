// Tests warnings about the scene: in reports, in resumed builds, and in strict builds, where they
// are errors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/base/error.h"
#include "scheduler/run_build.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag {
namespace {

using testing::HasSubstr;

struct LastWarning : NoProgress {
  void warn(std::string_view message) override { last = message; }
  std::string last;
};

class SceneWarnings : public testing::Test {
 protected:
  SceneWarnings() {
    spec_.geometry.resolution = 64;
    spec_.run.output = folder_.file("out.vdag");
    spec_.run.memory_bytes = uint64_t{256} << 20;
    spec_.run.threads = 1;
    spec_.run.keep_work = true;
  }

  // Writes a PLY file with four vertices. `faces` are the lines of its `count` faces.
  void write_scene(const std::string& faces, int count) {
    spec_.geometry.scenes = {folder_.file("mesh.ply")};
    std::ofstream(spec_.geometry.scenes[0])
        << "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
           "property float z\nelement face "
        << count
        << "\nproperty list uchar uint vertex_indices\nend_header\n"
           "0 0 0\n1 0 0\n1 1 0\n0 1 1\n"
        << faces;
  }
  BuildReport build() { return run_build(spec_, {system_files(), progress_, never_}); }
  std::string message() {
    try {
      build();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
      return error.message();
    }
    return "";
  }

  TemporaryFolder folder_;
  BuildSpec spec_;
  LastWarning progress_;
  CancelToken never_;
};

TEST_F(SceneWarnings, AreInTheReportOfEachRun) {
  write_scene("3 0 1 2\n2 0 1\n3 0 2 3\n1 0\n", 4);
  const std::vector<Warning> expected = {{"degenerate-faces", spec_.geometry.scenes[0],
                                          "faces of fewer than three corners make no voxels", 2}};
  EXPECT_EQ(build().warnings, expected);
  EXPECT_THAT(progress_.last, HasSubstr("(2 times)"));
  EXPECT_EQ(build().warnings, expected) << "the second run uses the work folder";
  const BuildReport copy = decode_report(report_json(build()));
  EXPECT_EQ(copy.warnings, expected);
}

TEST_F(SceneWarnings, AreErrorsInAStrictBuild) {
  write_scene("3 0 1 2\n2 0 1\n", 2);
  spec_.run.strict = true;
  EXPECT_THAT(message(), HasSubstr("fewer than three corners make no voxels; --strict makes"));
  spec_.run.strict = false;
  build();
  spec_.run.strict = true;
  EXPECT_THAT(message(), HasSubstr("--strict")) << "the warning of the earlier run counts";
  spec_.run.restart = true;
  write_scene("3 0 1 2\n", 1);
  EXPECT_EQ(message(), "");
}

TEST_F(SceneWarnings, ColorsOfAWhiteSceneAreWorthOne) {
  write_scene("3 0 1 2\n", 1);
  spec_.geometry.attributes.add(Attribute::kColor);
  spec_.geometry.color_resolution = 64;
  const std::vector<Warning> warnings = build().warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].code, "no-colors");
  EXPECT_EQ(warnings[0].place, spec_.geometry.scenes[0]);
  EXPECT_EQ(build().warnings, warnings) << "the second run uses the work folder";
  spec_.run.restart = true;
  std::ofstream(spec_.geometry.scenes[0])
      << "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
         "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
         "element face 1\nproperty list uchar uint vertex_indices\nend_header\n"
         "0 0 0 255 255 255\n1 0 0 255 255 255\n1 1 0 255 254 255\n3 0 1 2\n";
  EXPECT_TRUE(build().warnings.empty());
}

TEST_F(SceneWarnings, AnEmptySceneIsAnErrorThatSaysWhy) {
  write_scene("2 0 1\n", 1);
  EXPECT_THAT(message(), HasSubstr("has no triangles; "));
  EXPECT_THAT(message(), HasSubstr("fewer than three corners"));
  write_scene("3 0 1 2\n", 1);
  spec_.geometry.bounds = {{50, 50, 50, 1}};
  EXPECT_THAT(message(), HasSubstr("has 1 triangle, all outside the grid"));
  spec_.run.allow_empty = true;
  EXPECT_EQ(build().warnings.back().code, "empty-scene");
}

// Without `allow_empty`, a scene whose triangles set no voxel is an error that states the reason.
TEST_F(SceneWarnings, AVanishedSceneIsAnErrorThatSaysWhy) {
  write_scene("3 0 0 1\n", 1);
  spec_.geometry.thin = true;
  EXPECT_THAT(message(), HasSubstr("sets a voxel, because --thin leaves out triangles"));
  spec_.run.allow_empty = true;
  EXPECT_EQ(build().warnings.back().code, "no-voxels");
}

// A broken alpha mode gives a warning, and hides nothing. A cutoff above 1 hides the scene.
TEST_F(SceneWarnings, AlphaThatHidesTheScene) {
  test::SceneBuilder scene = test::one_triangle();
  scene.root["meshes"][0]["primitives"][0]["material"] = 0;
  const auto write = [&](const char* mode) {
    scene.root["materials"] = {{{"alphaMode", mode}, {"alphaCutoff", 2}}};
    spec_.geometry.scenes = {folder_.file("mesh.glb")};
    std::ofstream(spec_.geometry.scenes[0]) << scene.glb();
  };
  spec_.geometry.cutouts = CutoutRule::kSkip;
  write("mask");
  const std::vector<Warning> warnings = build().warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].code, "broken-material");
  spec_.run.restart = true;
  write("MASK");
  EXPECT_THAT(message(), HasSubstr("sets a voxel, because --cutouts skip leaves out surfaces"));
  spec_.run.allow_empty = true;
  EXPECT_EQ(build().warnings.back().code, "no-voxels");
}

}  // namespace
}  // namespace voxdag
