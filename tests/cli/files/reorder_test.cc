// Tests the command reorder. Also runs every command that reads a file on a reordered file: the
// command must give the same result as on the original file, or reject the reordered file.
#include <array>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class Reorder : public CommandLine {
 protected:
  // Builds hash.vdag with all attributes and plain.vdag without attributes. Reorders them to
  // first.vdag and plain_first.vdag.
  void SetUp() override {
    ASSERT_EQ(run({"generate", "city", "c.glb", "--triangles", "1000", "--colors"}).status, 0);
    run_json({"build", "c.glb", "-r", "64", "-o", "hash.vdag", "--attributes",
              "color,alpha,normal,material"});
    run_json({"build", "c.glb", "-r", "64", "-o", "plain.vdag"});
    run_json({"reorder", "hash.vdag", "-o", "first.vdag"});
    run_json({"reorder", "plain.vdag", "-o", "plain_first.vdag"});
  }
  // Runs the command with `file` in place of "FILE". Returns its standard output without the
  // members that differ between runs, followed by the contents of the file "out" if it exists.
  std::string result_of(std::vector<std::string> command, const std::string& file) {
    for (std::string& argument : command)
      if (argument == "FILE") argument = file;
    const Answer answer = run(command);
    EXPECT_EQ(answer.status, 0) << answer.err;
    Json json = Json::parse(answer.out, nullptr, false);
    if (json.is_object())
      for (const char* name : {"file", "node_order", "wall_s", "cpu_s", "peak_rss_bytes"})
        json.erase(name);
    const std::string text = json.is_object() ? json.dump() : "";
    return text + (exists("out") ? contents("out") : "");
  }
};

using Commands = std::vector<std::vector<std::string>>;

// The results of these commands do not depend on the order of the nodes.
TEST_F(Reorder, CommandsThatReadBothOrders) {
  const Commands commands = {
      {"info", "FILE", "--stats", "--json"},
      {"verify", "FILE", "--json"},
      {"verify", "FILE", "--against", "c.glb", "--json"},
      {"diff", "hash.vdag", "FILE", "--color", "--json"},
      {"diff", "FILE", "first.vdag", "--color", "--json"},
      {"extract", "FILE", "-o", "out", "--force", "--json"},
      {"extract", "FILE", "-o", "out", "--level", "4", "--force", "--json"},
      {"extract", "FILE", "-o", "out", "--region", "3,4,5,40,41,42", "--force", "--json"},
      {"render", "FILE", "-o", "out", "--size", "64x48", "--force"},
      {"reorder", "FILE", "-o", "out", "--order", "hash", "--force", "--json"},
      {"reorder", "FILE", "-o", "out", "--order", "first-parent", "--force", "--json"},
      {"export", "FILE", "--to", "vox", "-o", "out", "--force"},
      {"export", "FILE", "--to", "bt", "-o", "out", "--force"},
      {"export", "FILE", "--to", "ply", "-o", "out", "--force"},
      {"export", "FILE", "--to", "npz", "-o", "out", "--force"},
      {"export", "FILE", "--to", "vtu", "-o", "out", "--force"},
      {"export", "FILE", "--to", "inp", "-o", "out", "--force"},
      {"export", "FILE", "--to", "glb", "-o", "out", "--force"},
  };
  for (const auto& command : commands) {
    SCOPED_TRACE(Json(command).dump());
    EXPECT_TRUE(result_of(command, "hash.vdag") == result_of(command, "first.vdag"));
  }
}

// Exported DAGs contain the nodes of the file, so an export of a reordered file has the same size.
// The order of its nodes can differ.
TEST_F(Reorder, ExportsOfDags) {
  const std::array<const char*, 3> exports[] = {
      // format, name of the output, name of the file with the nodes
      {"hashdag", "x.basic_dag.dag.bin", "x.basic_dag.dag.bin"},
      {"svdag", "x", "x"},
      {"voxel", "x.voxel.json", "x.voxel.bin"},
  };
  for (const auto& row : exports) {
    const char *const format = row[0], *const output = row[1], *const nodes = row[2];
    SCOPED_TRACE(format);
    const auto size_of = [&](const char* file) {
      const Answer answer = run({"export", file, "--to", format, "-o", output, "--force"});
      EXPECT_EQ(answer.status, 0) << answer.err;
      return contents(nodes).size();
    };
    EXPECT_EQ(size_of("plain.vdag"), size_of("plain_first.vdag"));
  }
}

TEST_F(Reorder, CommandsThatNeedTheOrderByHash) {
  const Commands commands = {
      {"combine", "plain_first.vdag", "--union", "plain.vdag", "-o", "x.vdag"},
      {"combine", "plain.vdag", "--minus", "plain_first.vdag", "-o", "x.vdag"},
      {"combine", "plain_first.vdag", "--xor", "plain.vdag", "--offset", "1,0,0", "-o", "x.vdag"},
      {"edit", "plain_first.vdag", "--cut", "box:0,0,0,9,9,9", "-o", "x.vdag"},
      {"edit", "plain_first.vdag", "--add", "c.glb", "-o", "x.vdag"},
      {"edit", "plain_first.vdag", "--paste", "plain.vdag@0,0,0", "-o", "x.vdag"},
  };
  for (const auto& command : commands) {
    SCOPED_TRACE(Json(command).dump());
    expect_error(2,
                 "plain_first.vdag has its nodes in the order first-parent: expected the order "
                 "hash, which voxdag reorder --order hash writes",
                 command);
    EXPECT_FALSE(exists("x.vdag"));
  }
  // A file to paste can have either order, because its nodes are sorted again.
  const Json pasted =
      run_json({"edit", "plain.vdag", "--paste", "plain_first.vdag@0,0,0", "-o", "x.vdag"});
  EXPECT_EQ(pasted["sha256"], run_json({"info", "plain.vdag", "--digest"})["sha256"]);
}

// A build with --order writes the same file as a build without --order followed by the command
// reorder, also with attributes. A build refuses the work folder of a build with another order.
TEST_F(Reorder, Builds) {
  const Json plain = run_json({"build", "c.glb", "-r", "64", "-o", "x.vdag", "--order",
                               "first-parent", "--memory", "64MiB", "--keep-work"});
  EXPECT_TRUE(contents("x.vdag") == contents("plain_first.vdag"));
  EXPECT_EQ(plain["node_order"], "first-parent");
  EXPECT_EQ(plain["sha256"], run_json({"info", "x.vdag", "--digest"})["sha256"]);
  const Json again = run_json({"build", "c.glb", "-r", "64", "-o", "x.vdag", "--order",
                               "first-parent", "--memory", "64MiB", "--keep-work"});
  EXPECT_EQ(again["sha256"], plain["sha256"]);
  expect_error(2, "order", {"build", "c.glb", "-r", "64", "-o", "x.vdag", "--keep-work"});
  run_json({"build", "c.glb", "-r", "64", "-o", "y.vdag", "--attributes",
            "color,alpha,normal,material", "--order", "first-parent"});
  EXPECT_TRUE(contents("y.vdag") == contents("first.vdag"));
}

TEST_F(Reorder, ReportAndRefusals) {
  const Json report =
      run_json({"reorder", "hash.vdag", "-o", "x.vdag", "--memory", "64MiB", "--threads", "1"});
  const Json info = run_json({"info", "x.vdag", "--digest"});
  for (const char* name : {"node_order", "dag_nodes", "bytes", "sha256"})
    EXPECT_EQ(report[name], info[name]) << name;
  EXPECT_EQ(info["node_order"], "first-parent");
  EXPECT_EQ(run_json({"info", "hash.vdag"})["node_order"], "hash");
  EXPECT_TRUE(contents("x.vdag") == contents("first.vdag"));
  run_json({"reorder", "x.vdag", "-o", "back.vdag", "--order", "hash"});
  EXPECT_TRUE(contents("back.vdag") == contents("hash.vdag"));
  EXPECT_EQ(run({"verify", "x.vdag", "--quick"}).status, 0);
  EXPECT_NE(run({"info", "x.vdag"}).out.find("nodes in the order first-parent"), std::string::npos);
  expect_error(2, "--force", {"reorder", "hash.vdag", "-o", "x.vdag"});
  expect_error(2, "hash.vdag", {"reorder", "hash.vdag", "-o", "hash.vdag", "--force"});
  expect_error(2, "--order", {"reorder", "hash.vdag", "-o", "y.vdag", "--order", "depth"});
  expect_error(4, "c.glb", {"reorder", "c.glb", "-o", "y.vdag"});
}

}  // namespace
}  // namespace command_line
