// Tests the command edit, and combine at an offset, against builds and other commands.
#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class Edit : public CommandLine {
 protected:
  void SetUp() override {
    for (const std::string name : {"a", "b"})
      ASSERT_EQ(run({"generate", "soup", name + ".glb", "--triangles", "500", "--seed",
                     name == "a" ? "1" : "2"})
                    .status,
                0);
    build({"a.glb"}, "a.vdag");
  }
  // Builds in a grid of 128 voxels per edge; the edge of a voxel is 16. `shift` moves the scene
  // relative to the grid, in voxels.
  Json build(std::vector<std::string> scenes, const std::string& output,
             const std::array<int, 3>& shift = {}, const std::vector<std::string>& options = {}) {
    scenes.insert(scenes.begin(), "build");
    std::string bounds;
    for (const int voxels : shift) bounds += std::to_string(-1024 - 16 * voxels) + ",";
    for (const std::string& argument :
         {std::string("-r"), std::string("128"), std::string("--bounds"), bounds + "2048",
          std::string("-o")})
      scenes.push_back(argument);
    scenes.push_back(output);
    scenes.insert(scenes.end(), options.begin(), options.end());
    return run_json(scenes);
  }
  void expect_equal(const std::string& a, const std::string& b) const {
    EXPECT_TRUE(contents(a) == contents(b)) << a << " " << b;
  }
};

// With --offset, combine moves the voxels of the second file. The moved file equals a build of the
// moved scene.
TEST_F(Edit, OffsetEqualsAMovedScene) {
  build({"a.glb"}, "moved.vdag", {3, 0, -5});
  const Json same = run_json(
      {"combine", "moved.vdag", "--xor", "a.vdag", "--offset", "3,0,-5", "-o", "none.vdag"});
  EXPECT_EQ(same["voxels"], 0);
  EXPECT_EQ(same["clipped_voxels"], 0);
  run_json({"combine", "a.vdag", "--minus", "a.vdag", "-o", "empty.vdag"});
  const Json back = run_json(
      {"combine", "empty.vdag", "--union", "moved.vdag", "--offset", "-3,0,5", "-o", "back.vdag"});
  EXPECT_EQ(back["sha256"], run_json({"info", "a.vdag", "--digest"})["sha256"]);
}

TEST_F(Edit, OffsetOutOfTheGrid) {
  expect_error(2, "voxels would be outside of the grid",
               {"combine", "a.vdag", "--union", "a.vdag", "--offset", "100,0,0", "-o", "x.vdag"});
  expect_error(2, "three whole numbers",
               {"combine", "a.vdag", "--union", "a.vdag", "--offset", "1,2", "-o", "x.vdag"});
  const Json clipped = run_json(
      {"combine", "a.vdag", "--union", "a.vdag", "--offset", "100,0,0", "--clip", "-o", "x.vdag"});
  EXPECT_GT(clipped["clipped_voxels"], 0);
}

// The result of --add equals one build of both scenes.
TEST_F(Edit, AddEqualsOneBuild) {
  const Json both = build({"a.glb", "b.glb"}, "both.vdag");
  const Json added = run_json({"edit", "a.vdag", "--add", "b.glb", "-o", "c.vdag"});
  EXPECT_EQ(added["sha256"], both["sha256"]);
  expect_equal("c.vdag", "both.vdag");
}

// A box is extracted to a cropped file and cut from the original file. Pasting the cropped file
// into the hole restores the original bytes.
TEST_F(Edit, CutAndPaste) {
  const std::string region = "32,32,64,64,64,96";
  run_json({"edit", "a.vdag", "--cut", "box:" + region, "-o", "hole.vdag"});
  run_json({"extract", "a.vdag", "--region", region, "--crop", "-o", "part.vdag"});
  EXPECT_LT(run_json({"info", "part.vdag"})["resolution"], 128);
  EXPECT_GT(run_json({"info", "part.vdag"})["voxels"], 0);
  run_json({"edit", "hole.vdag", "--paste", "part.vdag@32,32,64", "-o", "c.vdag"});
  expect_equal("c.vdag", "a.vdag");
  // One command applies its edits in the order cut, add, paste, whatever the order of its options.
  // So it cuts the box first and then restores it.
  run_json({"edit", "a.vdag", "--paste", "part.vdag@32,32,64", "--cut", "box:" + region, "-o",
            "d.vdag"});
  expect_equal("d.vdag", "a.vdag");
}

TEST_F(Edit, Spheres) {
  const Json cut = run_json({"edit", "a.vdag", "--cut", "sphere:64,64,64,30", "--cut",
                             "sphere:64,64,64.5,31", "-o", "c.vdag"});
  EXPECT_GT(cut["pairs"], 0);
  EXPECT_LT(cut["voxels"], run_json({"info", "a.vdag"})["voxels"]);
  EXPECT_EQ(cut["sha256"], run_json({"info", "c.vdag", "--digest"})["sha256"]);
}

// A dilation comes after the other edits. Closing (a dilation and then an erosion) keeps all
// voxels.
TEST_F(Edit, DilateAndErode) {
  const std::string box = "box:32,32,64,64,64,96";
  run_json({"edit", "a.vdag", "--cut", box, "-o", "hole.vdag"});
  run_json({"edit", "hole.vdag", "--dilate", "3", "-o", "two.vdag"});
  const Json one = run_json({"edit", "a.vdag", "--dilate", "3", "--cut", box, "-o", "one.vdag",
                             "--memory", "64MiB", "--threads", "2"});
  EXPECT_EQ(one["sha256"], run_json({"info", "one.vdag", "--digest"})["sha256"]);
  expect_equal("one.vdag", "two.vdag");
  EXPECT_EQ(run({"verify", "one.vdag"}).status, 0);
  run_json({"edit", "one.vdag", "--erode", "3", "--outside-set", "-o", "closed.vdag"});
  EXPECT_EQ(
      run_json({"combine", "hole.vdag", "--minus", "closed.vdag", "-o", "none.vdag"})["voxels"], 0);
  const Json opened = run_json({"edit", "a.vdag", "--erode", "1", "-o", "opened.vdag"});
  EXPECT_LT(opened["voxels"], run_json({"info", "a.vdag"})["voxels"]);
}

TEST_F(Edit, DilationsWithAttributes) {
  build({"a.glb"}, "a.vdag", {},
        {"--color", "--attributes", "normal,material", "--color-resolution", "64", "--force"});
  const Json dilated = run_json({"edit", "a.vdag", "--dilate", "2", "-o", "dilated.vdag"});
  EXPECT_EQ(run_json({"info", "dilated.vdag"})["colors"]["resolution"], 64);
  EXPECT_EQ(run({"verify", "dilated.vdag"}).status, 0);
  run_json({"edit", "dilated.vdag", "--erode", "2", "--outside-set", "-o", "closed.vdag"});
  EXPECT_EQ(run({"verify", "closed.vdag"}).status, 0);
  const Json plain =
      run_json({"edit", "a.vdag", "--dilate", "2", "--no-attributes", "-o", "plain.vdag"});
  EXPECT_EQ(plain["voxels"], dilated["voxels"]);
}

TEST_F(Edit, RefusesDistances) {
  for (const std::string distance : {"0", "-1", "1.5", "1048577", "x"})
    expect_error(2, "1048576", {"edit", "a.vdag", "--dilate", distance, "-o", "x.vdag"});
  expect_error(2, "--dilate", {"edit", "a.vdag", "--dilate", "1", "--erode", "1", "-o", "x.vdag"});
  expect_error(2, "--outside-set was given without an erosion: expected --erode",
               {"edit", "a.vdag", "--dilate", "1", "--outside-set", "-o", "x.vdag"});
}

// Cuts keep the colors of the other voxels, --add builds the scene with colors, and a part is
// pasted with its colors.
TEST_F(Edit, Colors) {
  build({"a.glb"}, "a.vdag", {}, {"--color", "--color-resolution", "64", "--force"});
  const auto different = [&](const std::string& x, const std::string& y) {
    return Json::parse(run({"diff", x, y, "--color", "--json"}).out)["colors"]["different"];
  };
  const std::string region = "32,32,64,64,64,96";
  run_json({"edit", "a.vdag", "--cut", "box:" + region, "-o", "hole.vdag"});
  EXPECT_EQ(different("hole.vdag", "a.vdag"), 0);
  run_json({"extract", "a.vdag", "--region", region, "--crop", "-o", "part.vdag"});
  run_json({"edit", "hole.vdag", "--paste", "part.vdag@32,32,64", "-o", "back.vdag"});
  EXPECT_EQ(different("back.vdag", "a.vdag"), 0);
  const Json both = build({"a.glb", "b.glb"}, "both.vdag", {}, {"--color"});
  const Json added = run_json({"edit", "a.vdag", "--add", "b.glb", "-o", "added.vdag"});
  EXPECT_EQ(added["voxels"], both["voxels"]);
  EXPECT_EQ(run_json({"info", "added.vdag"})["colors"]["resolution"], 64);
  EXPECT_EQ(run({"verify", "added.vdag"}).status, 0);
  const Json plain =
      run_json({"edit", "a.vdag", "--add", "b.glb", "--no-attributes", "-o", "plain.vdag"});
  EXPECT_EQ(plain["voxels"], both["voxels"]);
  EXPECT_FALSE(run_json({"info", "plain.vdag"}).contains("colors"));
  // The cut removes all voxels. The scene is still built with the colors of the original file.
  run_json(
      {"edit", "a.vdag", "--cut", "box:0,0,0,128,128,128", "--add", "b.glb", "-o", "only.vdag"});
  build({"b.glb"}, "b.vdag", {}, {"--color", "--color-resolution", "64"});
  expect_equal("only.vdag", "b.vdag");
}

// Parts that cannot be pasted are refused before the first edit. The messages name the files that
// the user gave, and not the files of earlier edits.
TEST_F(Edit, ChecksPartsFirst) {
  run_json({"extract", "a.vdag", "--region", "32,32,64,64,64,96", "--crop", "-o", "part.vdag"});
  run_json({"extract", "a.vdag", "-o", "coarse.vdag", "--level", "6"});
  build({"b.glb"}, "colored.vdag", {}, {"--color"});
  const auto expect_refused = [&](const std::string& expected, const std::string& part) {
    const Answer answer = run({"edit", "a.vdag", "--cut", "sphere:64,64,64,30", "--add", "none.glb",
                               "--paste", "part.vdag@1,2,3", "--paste", part, "-o", "x.vdag"});
    EXPECT_EQ(answer.status, 2);
    EXPECT_NE(answer.err.find(expected), std::string::npos) << answer.err;
    EXPECT_EQ(answer.err.find(".work-"), std::string::npos) << answer.err;
  };
  expect_refused("only files with equal voxels can be combined: a voxel of a.vdag has the edge 16",
                 "coarse.vdag@0,0,0");
  expect_refused("colored.vdag has colors and a.vdag has none", "colored.vdag@0,0,0");
  expect_refused("part.vdag: some of its voxels would be outside of the grid of a.vdag",
                 "part.vdag@120,0,0");
  const Answer unused = run(
      {"edit", "a.vdag", "--paste", "part.vdag@1,2,3", "--fill-color", "ff8000", "-o", "x.vdag"});
  EXPECT_EQ(unused.status, 0);
  EXPECT_NE(unused.err.find("--fill-color has no effect"), std::string::npos) << unused.err;
}

TEST_F(Edit, RefusesBadArguments) {
  expect_error(2, "no edit was given: expected --cut, --add, --paste, --dilate or --erode",
               {"edit", "a.vdag", "-o", "x.vdag"});
  expect_error(2, "shape 'cone:1'", {"edit", "a.vdag", "--cut", "cone:1", "-o", "x.vdag"});
  for (const std::string part : {"a.vdag", "a.vdag@", "a.vdag@1,2", "@1,2,3"})
    expect_error(2, "--paste '" + part + "': expected a .vdag file and three whole numbers",
                 {"edit", "a.vdag", "--paste", part, "-o", "x.vdag"});
  expect_error(3, "none.glb", {"edit", "a.vdag", "--add", "none.glb", "-o", "x.vdag"});
  expect_error(2, "a.vdag",
               {"edit", "a.vdag", "--cut", "sphere:0,0,0,5", "-o", "a.vdag", "--force"});
  put("mine.txt", "not a DAG");
  expect_error(2, "mine.txt", {"edit", "a.vdag", "--cut", "sphere:0,0,0,5", "-o", "mine.txt"});
  EXPECT_EQ(contents("mine.txt"), "not a DAG");
  build({"a.glb"}, "colored.vdag", {}, {"--color"});
  expect_error(2, "--fill-color",
               {"edit", "a.vdag", "--paste", "colored.vdag@0,0,0", "-o", "x.vdag"});
  expect_error(2, "six hexadecimal digits",
               {"edit", "a.vdag", "--paste", "colored.vdag@0,0,0", "--fill-color", "#ff000", "-o",
                "x.vdag"});
  const auto expect_wrong_cells = [&](const std::string& cells, const std::string& expected) {
    expect_error(2, expected,
                 {"combine", "colored.vdag", "--union", "colored.vdag", "--color-resolution", cells,
                  "-o", "x.vdag"});
  };
  expect_wrong_cells("1k", "--color-resolution 1024: expected a power of two from 4 to 128");
  expect_wrong_cells("1x", "--color-resolution: '1x': expected a number of voxels such as 4096");
  expect_error(2, "--chunks 0: expected a power of two",
               {"export", "a.vdag", "--to", "ply", "-o", "x", "--chunks", "0"});
  EXPECT_EQ(run({"export", "a.vdag", "--to", "ply", "-o", "chunks", "--chunks", "1k"}).status, 0);
  EXPECT_FALSE(exists("x.vdag") || exists("x.vdag.partial") || exists("x.vdag.lock"));
}

// `edit` shares the code of `build`, but not all of its options. Messages do not recommend options
// that only `build` has as if `edit` had them.
TEST_F(Edit, RecommendsItsOwnOptions) {
  put("far.obj", "v 9000 0 0\nv 9001 0 0\nv 9000 1 0\nf 1 2 3\n");
  put("bad.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const auto add = [](const std::string& scene) -> std::vector<std::string> {
    return {"edit", "a.vdag", "--add", scene, "-o", "x.vdag"};
  };
  expect_error(2,
               "far.obj: has 1 triangle, all outside the grid (from -1024,-1024,-1024 to "
               "1024,1024,1024): expected a scene that sets voxels in the grid",
               add("far.obj"));
  expect_error(2, "--skip-invalid of voxdag build", add("bad.obj"));
  expect_error(2, "--skip-invalid ", {"build", "bad.obj", "-r", "64", "-o", "x.vdag"});
  expect_error(2, "; --allow-empty writes a file without voxels",
               {"build", "far.obj", "-r", "64", "--bounds", "0,0,0,1", "-o", "x.vdag"});
}

// The output must not be a pasted file, an added scene or a file that an added scene names, also
// not with --force.
TEST_F(Edit, KeepsItsInputs) {
  const auto expect_kept = [&](const std::string& name, const std::string& option,
                               const std::string& value) {
    const std::string before = contents(name);
    expect_error(2, name + " is an input and would be overwritten",
                 {"edit", "a.vdag", option, value, "-o", name, "--force"});
    EXPECT_TRUE(contents(name) == before) << name;
  };
  build({"b.glb"}, "part.vdag");
  put("scene.obj", "mtllib scene.mtl\nusemtl m\nv 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n");
  put("scene.mtl", "newmtl m\nKd 1 0 0\nmap_Kd image.png\n");
  put("image.png", "not an image");
  expect_kept("part.vdag", "--paste", "part.vdag@0,0,0");
  expect_kept("scene.obj", "--add", "scene.obj");
  expect_kept("scene.mtl", "--add", "scene.obj");
  expect_kept("image.png", "--add", "scene.obj");
  put("other.vdag", "");
  run_json({"edit", "a.vdag", "--add", "scene.obj", "-o", "other.vdag"});
}

}  // namespace
}  // namespace command_line
