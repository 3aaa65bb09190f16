// Tests the options and the report of combine, and compares results with builds.
#include <filesystem>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class Combine : public CommandLine {
 protected:
  void SetUp() override {
    for (const std::string name : {"a", "b"}) {
      ASSERT_EQ(run({"generate", "soup", name + ".glb", "--triangles", "2000", "--seed",
                     name == "a" ? "1" : "2"})
                    .status,
                0);
      build({name + ".glb"}, name + ".vdag");
    }
  }
  Json build(std::vector<std::string> scenes, const std::string& output,
             const std::vector<std::string>& options = {}) {
    scenes.insert(scenes.begin(), "build");
    for (const std::string argument : {"-r", "256", "--bounds", "-512,-512,-512,1024", "-o"})
      scenes.push_back(argument);
    scenes.push_back(output);
    scenes.insert(scenes.end(), options.begin(), options.end());
    return run_json(scenes);
  }
};

// The union of two builds has the bytes of one build of both scenes.
TEST_F(Combine, UnionEqualsOneBuild) {
  const Json both = build({"a.glb", "b.glb"}, "both.vdag");
  const Json combined =
      run_json({"combine", "a.vdag", "--union", "b.vdag", "-o", "c.vdag", "--memory", "64MiB"});
  EXPECT_EQ(combined["sha256"], both["sha256"]);
  EXPECT_TRUE(contents("c.vdag") == contents("both.vdag"));
  EXPECT_GT(combined["pairs"], 0);
  const Json info = run_json({"info", "c.vdag", "--digest"});
  for (const char* name :
       {"resolution", "bounds", "voxels", "svo_nodes", "dag_nodes", "bytes", "sha256"})
    EXPECT_EQ(combined[name], info[name]) << name;
}

// The voxel counts of --minus, --xor and --and agree with the counts of diff, which counts the
// voxels that only one of the files has.
TEST_F(Combine, AgreesWithDiff) {
  const Json diff = Json::parse(run({"diff", "a.vdag", "b.vdag", "--json"}).out);
  const auto voxels = [&](const char* operation) {
    return run_json({"combine", "a.vdag", operation, "b.vdag", "-o", "c.vdag", "--force"})["voxels"]
        .get<uint64_t>();
  };
  EXPECT_EQ(voxels("--minus"), diff["only_a"]);
  EXPECT_EQ(voxels("--xor"), diff["only_a"].get<uint64_t>() + diff["only_b"].get<uint64_t>());
  EXPECT_EQ(voxels("--and") + voxels("--xor"), voxels("--union"));
  const Answer empty = run({"combine", "a.vdag", "--xor", "a.vdag", "-o", "c.vdag", "--force"});
  EXPECT_EQ(empty.status, 0);
  EXPECT_NE(empty.err.find("the result has no voxels"), std::string::npos) << empty.err;
}

TEST_F(Combine, Refusals) {
  expect_error(2, "expected one of --union", {"combine", "a.vdag", "-o", "x.vdag"});
  expect_error(2, "expected one of --union",
               {"combine", "a.vdag", "--union", "b.vdag", "--and", "b.vdag", "-o", "x.vdag"});
  expect_error(2, "a.vdag", {"combine", "a.vdag", "--union", "b.vdag", "-o", "a.vdag", "--force"});
  expect_error(2, "b.vdag", {"combine", "a.vdag", "--union", "b.vdag", "-o", "b.vdag", "--force"});
  expect_error(3, "none", {"combine", "a.vdag", "--union", "none.vdag", "-o", "x.vdag"});
  expect_error(4, "a.glb", {"combine", "a.vdag", "--union", "a.glb", "-o", "x.vdag"});
  run_json({"extract", "b.vdag", "-o", "small.vdag", "--level", "7"});
  expect_error(2, "files of the same grid",
               {"combine", "a.vdag", "--union", "small.vdag", "-o", "x.vdag"});
  build({"b.glb"}, "colored.vdag", {"--color"});
  expect_error(2, "colored.vdag has colors and a.vdag has none: expected colors in both files",
               {"combine", "a.vdag", "--union", "colored.vdag", "-o", "x.vdag"});
  put("mine.txt", "not a DAG");
  expect_error(2, "mine.txt", {"combine", "a.vdag", "--union", "b.vdag", "-o", "mine.txt"});
  EXPECT_EQ(contents("mine.txt"), "not a DAG");
  EXPECT_FALSE(exists("x.vdag") || exists("x.vdag.partial") || exists("x.vdag.lock"));
}

}  // namespace
}  // namespace command_line
