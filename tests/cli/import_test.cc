// `voxdag import`, from a file of another format to a .vdag.
#include "tests/cli/command_line.h"
#include "tests/support/image_files.h"

namespace command_line {
namespace {

constexpr const char* kOff = "OFF\n4 2 0\n0 0 0\n4 1 0\n0 2 0\n1 1 0\n4 0 1 2 3\n3 0 1 3\n";

class Import : public CommandLine {
 protected:
  void SetUp() override {
#ifndef VOXDAG_HAS_ASSIMP
    GTEST_SKIP() << "this program has no voxdag import";
#endif
    put("a.off", kOff);
  }
};

TEST_F(Import, TheErrorOfTheFormatNamesTheCommand) {
  expect_error(2, "voxdag import IN OUT.glb", {"build", "a.off", "-r", "64", "-o", "a.vdag"});
}

TEST_F(Import, MakesASceneThatCanBeBuilt) {
  const Json report = run_json({"import", "a.off", "a.glb"});
  EXPECT_EQ(report["triangles"], 3);
  EXPECT_EQ(report["warnings"], Json::array());
  EXPECT_FALSE(exists("a.glb.partial"));
  EXPECT_EQ(run({"build", "a.glb", "-r", "64", "-o", "a.vdag"}).status, 0);
  // Without --force, import overwrites a file only if an earlier import wrote it.
  EXPECT_EQ(run({"import", "a.off", "a.glb"}).status, 0);
  put("other.glb", "something else");
  expect_error(2, "--force", {"import", "a.off", "other.glb"});
  EXPECT_EQ(run({"import", "a.off", "other.glb", "--force"}).status, 0);
  expect_error(2, "would be overwritten", {"import", "a.off", "a.off", "--force"});
}

// A scene can consist of several files. None of them is overwritten, even with --force.
TEST_F(Import, KeepsAllFilesOfTheScene) {
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
  put("s.obj", "mtllib s.mtl\nusemtl m\n" + triangle);
  put("s.mtl", "newmtl m\nmap_Kd s.png.partial\n");
  put("s.png.partial", voxdag::test::png_file({}, std::string(4, 0)));
  for (const char* output : {"s.obj", "s.mtl", "s.png.partial", "s.png"}) {
    SCOPED_TRACE(output);
    const std::string image = contents("s.png.partial"), library = contents("s.mtl");
    expect_error(2, "would be overwritten", {"import", "s.obj", output, "--force"});
    EXPECT_EQ(contents("s.png.partial"), image);
    EXPECT_EQ(contents("s.mtl"), library);
  }
  EXPECT_FALSE(exists("s.png"));
  EXPECT_EQ(run_json({"import", "s.obj", "s.glb", "--force"})["images"], 1);
}

TEST_F(Import, FaultsHaveTheirExitStatus) {
  expect_error(3, "none.off", {"import", "none.off", "b.glb"});
  put("b.xyzzy", "hello");
  expect_error(2, "b.xyzzy: has a format that cannot be imported", {"import", "b.xyzzy", "b.glb"});
  put("line.off", "OFF\n3 2 0\n0 0 0\n4 1 0\n0 2 0\n3 0 1 2\n2 0 1\n");
  EXPECT_NE(run({"import", "line.off", "b.glb"}).err.find("points and lines"), std::string::npos);
  EXPECT_EQ(run_json({"import", "line.off", "b.glb"})["warnings"][0]["code"], "points-or-lines");
  expect_error(2, "--strict makes this an error", {"import", "line.off", "c.glb", "--strict"});
  EXPECT_FALSE(exists("c.glb"));
}

}  // namespace
}  // namespace command_line
