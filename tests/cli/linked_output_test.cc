// No command replaces a symbolic link at its output, also with --force.
#include <filesystem>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class LinkedOutput : public CommandLine {
 protected:
  void SetUp() override {
    ASSERT_EQ(run({"generate", "soup", "s.glb", "--triangles", "200"}).status, 0);
    ASSERT_EQ(run({"build", "s.glb", "-r", "64", "-o", "s.vdag"}).status, 0);
    put("empty", "");
  }
  // Runs a command whose output is the link `link`. Expects that it fails before it changes
  // anything.
  void expect_refused(const std::string& link, const std::vector<std::string>& args) {
    for (const char* target : {"empty", "missing"}) {
      SCOPED_TRACE(args[0] + " to " + target);
      const std::string path = folder_.file(link);
      std::filesystem::create_symlink(target, path);
      const Answer answer = run(args);
      EXPECT_EQ(answer.status, 2) << answer.err;
      EXPECT_NE(answer.err.find(link + " is a symbolic link"), std::string::npos) << answer.err;
      EXPECT_EQ(std::filesystem::read_symlink(path), target);
      EXPECT_EQ(contents("empty"), "");
      EXPECT_FALSE(exists("missing"));
      std::filesystem::remove(path);
    }
  }
};

TEST_F(LinkedOutput, IsRefused) {
  expect_refused("o", {"build", "s.glb", "-r", "32", "-o", "o"});
  expect_refused("o.report.json", {"build", "s.glb", "-r", "32", "-o", "o"});
  expect_refused("o", {"build", "s.glb", "-r", "32", "-o", "o", "--force"});
  expect_refused("o", {"extract", "s.vdag", "-o", "o"});
  expect_refused("o", {"extract", "s.vdag", "-o", "o", "--force"});
  expect_refused("o.partial", {"extract", "s.vdag", "-o", "o"});
  expect_refused("o", {"reorder", "s.vdag", "-o", "o"});
  expect_refused("o", {"combine", "s.vdag", "--minus", "s.vdag", "-o", "o"});
  expect_refused("o", {"edit", "s.vdag", "--cut", "sphere:8,8,8,4", "-o", "o"});
  expect_refused("o", {"export", "s.vdag", "--to", "npz", "-o", "o"});
  expect_refused("o", {"publish", "s.vdag", "--single-file", "-o", "o"});
  expect_refused("o", {"generate", "soup", "o", "--triangles", "20"});
  expect_refused("o.glb", {"import", "s.glb", "o.glb"});
  expect_refused("o.png", {"render", "s.vdag", "-o", "o.png"});
  expect_refused("o.npy", {"render", "s.vdag", "--depth", "o.npy"});
}

TEST_F(LinkedOutput, IsRefusedInAPackage) {
  ASSERT_EQ(run({"publish", "s.vdag", "-o", "p"}).status, 0);
  for (const char* name : {"p/index.html", "p/package.json"}) {
    const std::string path = folder_.file(name), kept = folder_.file("kept");
    std::filesystem::rename(path, kept);
    std::filesystem::create_symlink("../kept", path);
    const Answer answer = run({"publish", "s.vdag", "-o", "p"});
    EXPECT_EQ(answer.status, 2) << answer.err;
    EXPECT_NE(answer.err.find(std::string(name) + " is a symbolic link"), std::string::npos)
        << answer.err;
    std::filesystem::remove(path);
    std::filesystem::rename(kept, path);
  }
}

}  // namespace
}  // namespace command_line
