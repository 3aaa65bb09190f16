// Builds of scenes whose materials cut out parts of their surfaces.
#include "tests/cli/command_line.h"
#include "tests/support/image_files.h"
#include "tests/unit/scene/scene_files.h"

namespace command_line {
namespace {

using voxdag::test::SceneBuilder;

// Returns a slanted quad with an image whose left half is green and opaque. The right half, where u
// > 0.5, is red and fully transparent, so that red never shows.
SceneBuilder half_quad(const char* alpha_mode) {
  SceneBuilder scene;
  const int positions = scene.add_positions({0, 0, 0, 4, 0, 0, 4, 4.5f, 1, 0, 4.5f, 1});
  const int texture = scene.add_accessor<float>("VEC2", 5126, {0, 1, 1, 1, 1, 0, 0, 0});
  const int indices = scene.add_accessor<uint16_t>("SCALAR", 5123, {0, 1, 2, 0, 2, 3});
  scene.add_root(
      {{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", texture}}},
                                {"indices", indices},
                                {"material", 0}})}});
  std::string pixels;
  for (int i = 0; i < 16 * 16; ++i)
    pixels += i % 16 < 8 ? std::string("\x1e\xa0\x5a\xff", 4) : std::string("\xff\0\0\0", 4);
  voxdag::test::PngFormat format;
  format.width = format.height = 16;
  scene.root["images"] = {
      {{"uri",
        "data:image/png;base64," + voxdag::test::base64(voxdag::test::png_file(format, pixels))}}};
  scene.root["textures"] = {{{"source", 0}}};
  scene.root["materials"] = {{{"alphaMode", alpha_mode},
                              {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  return scene;
}

class Cutouts : public CommandLine {
 protected:
  Json build(const std::vector<std::string>& more, const std::string& output) {
    std::vector<std::string> command{"build", "a.glb", "-r", "256", "-o", output};
    command.insert(command.end(), more.begin(), more.end());
    return run_json(command);
  }
};

// The transparent half of the quad sets no voxels. Options for threads, memory and the size of
// subvolumes do not change the bytes.
TEST_F(Cutouts, SkipLeavesOutHiddenVoxels) {
  for (const char* mode : {"MASK", "BLEND"}) {
    put("a.glb", half_quad(mode).glb());
    const Json kept = build({}, "keep.vdag");
    EXPECT_EQ(kept["warnings"][0]["code"], "kept-cutouts");
    const Json skipped = build({"--cutouts", "skip"}, "skip.vdag");
    EXPECT_TRUE(skipped["warnings"].empty());
    const double all = kept["voxels"], half = skipped["voxels"];
    EXPECT_NEAR(half / all, 0.5, 0.001);
    EXPECT_EQ(build({"--color"}, "color.vdag")["voxels"], half);
    EXPECT_EQ(build({"--color", "--cutouts", "keep"}, "b.vdag")["voxels"], all);
    const std::string sha = skipped["sha256"];
    for (const auto& more :
         std::vector<std::vector<std::string>>{{"--threads", "1"},
                                               {"--memory", "64MiB", "--subvolume", "64"},
                                               {"--backend", "parallel-host"}}) {
      std::vector<std::string> options{"--cutouts", "skip", "--force"};
      options.insert(options.end(), more.begin(), more.end());
      EXPECT_EQ(build(options, "c.vdag")["sha256"], sha);
    }
    for (const char* file : {"skip.vdag", "color.vdag"})
      EXPECT_EQ(run_json({"verify", file, "--against", "a.glb", "--cutouts", "skip"})["ok"], true);
    EXPECT_EQ(run_json({"verify", "color.vdag", "--against", "a.glb"})["ok"], true);
    EXPECT_EQ(run_json({"verify", "keep.vdag", "--against", "a.glb"})["ok"], true);
    expect_error(4, "is set", {"verify", "keep.vdag", "--against", "a.glb", "--cutouts", "skip"});
  }
}

}  // namespace
}  // namespace command_line
