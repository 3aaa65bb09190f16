// Tests the options and the report of extract, and compares extracts with builds.
#include <filesystem>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class Extract : public CommandLine {
 protected:
  void SetUp() override {
    ASSERT_EQ(run({"generate", "soup", "s.glb", "--triangles", "2000"}).status, 0);
    report_ = run_json({"build", "s.glb", "-r", "256", "-o", "s.vdag", "--bounds", kBounds});
    const Json origin = report_["bounds"]["origin"];
    ASSERT_EQ(origin.size(), 3u);
  }
  static constexpr const char* kBounds = "-512,-512,-512,1024";
  Json report_;
};

// The extract of an octree cube equals a build of this cube. The extract of the complete grid
// equals the input.
TEST_F(Extract, EqualsBuilds) {
  const Json whole = run_json({"extract", "s.vdag", "-o", "whole.vdag", "--memory", "64MiB"});
  EXPECT_EQ(whole["sha256"], report_["sha256"]);
  run_json({"build", "s.glb", "-r", "64", "-o", "cube.vdag", "--bounds", "-256,-512,0,256"});
  const Json cube = run_json({"extract", "s.vdag", "-o", "part.vdag", "--region",
                              "64,0,128,128,64,192", "--crop", "--threads", "3"});
  EXPECT_GT(cube["voxels"], 0);
  EXPECT_TRUE(contents("part.vdag") == contents("cube.vdag"));
  const Json world = run_json({"extract", "s.vdag", "-o", "world.vdag", "--region",
                               "-256,-512,0,0,-256,256", "--world", "--crop"});
  EXPECT_EQ(world["sha256"], cube["sha256"]);
}

// The process uses at most --memory plus 64 MiB, even if the resulting file is larger than this.
TEST_F(Extract, LargeResultsWithinLittleMemory) {
  constexpr uint64_t kMemory = 64 << 20, kAllowed = kMemory + (64 << 20);
  ASSERT_EQ(run({"generate", "soup", "large.glb", "--triangles", "45000"}).status, 0);
  run_json({"build", "large.glb", "-r", "8192", "-o", "large.vdag"});
  const Json part = run_json({"extract", "large.vdag", "-o", "part.vdag", "--region",
                              "1,1,1,8192,8192,8192", "--memory", "64MiB", "--threads", "2"});
  EXPECT_GT(part["bytes"], kAllowed);
  EXPECT_LE(part["peak_rss_bytes"], kAllowed);
}

// With --majority, a solid keeps about the same volume at a coarser level. Files with colors are
// refused.
TEST_F(Extract, Majority) {
  ASSERT_EQ(run({"generate", "menger", "b.glb", "--level", "1"}).status, 0);
  const Json solid = run_json({"build", "b.glb", "-r", "256", "--solid", "winding", "--bounds",
                               "-0.4,-0.4,-0.4,4", "-o", "b.vdag"});
  const Json kept = run_json(
      {"extract", "b.vdag", "-o", "kept.vdag", "--level", "5", "--majority", "--memory", "64MiB"});
  const double volume = solid["voxels"].get<double>() / 512;
  EXPECT_NEAR(kept["voxels"].get<double>(), volume, 0.1 * volume);
  const Json grown = run_json({"extract", "b.vdag", "-o", "grown.vdag", "--level", "5"});
  EXPECT_GT(grown["voxels"].get<double>(), 1.1 * volume);
  EXPECT_EQ(run_json({"verify", "kept.vdag"})["ok"], true);
  ASSERT_EQ(run({"generate", "city", "c.glb", "--triangles", "1000", "--colors"}).status, 0);
  run_json({"build", "c.glb", "-r", "64", "--color", "-o", "c.vdag"});
  expect_error(2, "c.vdag has colors: expected a file without colors and other attributes",
               {"extract", "c.vdag", "-o", "x.vdag", "--level", "4", "--majority"});
}

// The report has the same values as the outputs of info and verify.
TEST_F(Extract, Report) {
  const Json report = run_json({"extract", "s.vdag", "-o", "c.vdag", "--resolution", "32"});
  const Json info = run_json({"info", "c.vdag", "--digest"});
  for (const char* name : {"resolution", "bounds", "hash_bits", "voxels", "svo_nodes", "dag_nodes",
                           "bytes", "levels", "sha256"})
    EXPECT_EQ(report[name], info[name]) << name;
  EXPECT_EQ(info["resolution"], 32);
  EXPECT_EQ(info["bounds"], report_["bounds"]);
  EXPECT_GT(report["wall_s"], 0);
  EXPECT_EQ(run_json({"verify", "c.vdag"})["ok"], true);
  const Answer plain = run({"extract", "s.vdag", "-o", "d.vdag", "--level", "5"});
  EXPECT_EQ(plain.status, 0) << plain.err;
  EXPECT_NE(plain.out.find(info["sha256"]), std::string::npos) << plain.out;
  EXPECT_TRUE(contents("c.vdag") == contents("d.vdag"));
}

// A refused extract leaves no files. It overwrites neither its input nor, without --force, any
// existing file.
TEST_F(Extract, Refusals) {
  put("mine.txt", "not a DAG");
  expect_error(2, "mine.txt", {"extract", "s.vdag", "-o", "mine.txt"});
  EXPECT_EQ(contents("mine.txt"), "not a DAG");
  expect_error(2, "s.vdag", {"extract", "s.vdag", "-o", "s.vdag", "--force"});
  run_json({"extract", "s.vdag", "-o", "other.vdag", "--level", "4"});
  const std::string other = contents("other.vdag");
  expect_error(2, "--force", {"extract", "s.vdag", "-o", "other.vdag"});
  EXPECT_TRUE(contents("other.vdag") == other);
  expect_error(2, "64MiB", {"extract", "s.vdag", "-o", "x.vdag", "--memory", "63MiB"});
  expect_error(2, "--level 9: expected 2 to 8",
               {"extract", "s.vdag", "-o", "x.vdag", "--level", "9"});
  for (const char* wrong : {"3.5", "-3", "a"})
    expect_error(2, "--level", {"extract", "s.vdag", "-o", "x.vdag", "--level", wrong});
  expect_error(2, "--resolution 100: expected a power of two from 4 to 256",
               {"extract", "s.vdag", "-o", "x.vdag", "--resolution", "100"});
  expect_error(3, "none", {"extract", "none.vdag", "-o", "x.vdag"});
  expect_error(4, "mine.txt", {"extract", "mine.txt", "-o", "x.vdag"});
  run_json({"extract", "s.vdag", "-o", "mine.txt", "--force"});
  EXPECT_EQ(run_json({"verify", "mine.txt"})["ok"], true);
  size_t others = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    others += entry.path().string().find("x.vdag") != std::string::npos ||
              entry.path().string().find(".work") != std::string::npos;
  EXPECT_EQ(others, 0u);
}

// With the same options --resolution, --region, --world and --level, extract and export select the
// same number of voxels.
TEST_F(Extract, SelectionsOfExports) {
  const std::vector<std::vector<std::string>> selections = {
      {"--resolution", "32"},
      {"--region", "40,0,64,128,64,200"},
      {"--region", "-5,-5,-5,999,70,999"},
      {"--region", "-256,-512,0,0,-256,256", "--world"},
      {"--region", "-inf,-512,0,0,inf,256", "--world", "--level", "7"}};
  for (std::vector<std::string> selection : selections) {
    SCOPED_TRACE(selection[1]);
    selection.push_back("--force");
    std::vector<std::string> extract = {"extract", "s.vdag", "-o", "part.vdag"};
    std::vector<std::string> to_npz = {"export", "s.vdag", "--to", "npz", "-o", "part.npz"};
    extract.insert(extract.end(), selection.begin(), selection.end());
    to_npz.insert(to_npz.end(), selection.begin(), selection.end());
    const Json extracted = run_json(extract), exported = run_json(to_npz);
    EXPECT_GT(exported["voxels"], 0);
    EXPECT_EQ(exported["voxels"], extracted["voxels"]);
  }
}

TEST_F(Extract, RefusalsOfExports) {
  const auto refused = [&](const std::string& why, const std::vector<std::string>& options) {
    std::vector<std::string> args = {"export", "s.vdag", "--to", "ply"};
    args.insert(args.end(), options.begin(), options.end());
    expect_error(2, why, args);
  };
  refused("s.vdag is an input and would be overwritten", {"-o", "s.vdag", "--force"});
  refused("expected the name of a file", {"-o", ""});
  refused("64MiB", {"-o", "x.ply", "--memory", "1"});
  refused("expected X0 < X1", {"-o", "x.ply", "--region", "nan,0,0,1,1,1", "--world"});
  refused("expected X0 < X1", {"-o", "x.ply", "--region", "3,0,0,1,1,1"});
  refused("outside the grid", {"-o", "x.ply", "--region", "300,0,0,400,1,1"});
  put("x.ply", "mine");
  refused("x.ply exists", {"-o", "x.ply"});
  std::filesystem::create_directory(folder_.file("folder"));
  refused("folder is not a regular file", {"-o", "folder", "--force"});
  expect_error(3, "the folder none does not exist",
               {"export", "s.vdag", "--to", "ply", "-o", "none/x.ply"});
  EXPECT_EQ(contents("x.ply"), "mine");
  EXPECT_FALSE(exists("x.ply.partial") || exists("x.ply.lock") || exists(".ply.partial"));
}

}  // namespace
}  // namespace command_line
