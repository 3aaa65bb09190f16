// voxdag build: its report, its files, its options, its errors.
#include <sys/stat.h>

#include "core/base/process_limits.h"
#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class BuildCommand : public CommandLine {
 protected:
  void SetUp() override { make_scene(); }
  Json build(std::vector<std::string> more = {}, const std::string& output = "m.vdag") {
    std::vector<std::string> args = {"build", "m.glb", "-r", "128", "-o", output};
    args.insert(args.end(), more.begin(), more.end());
    return run_json(args);
  }
};

// The report has the documented members, and their values agree with the file.
TEST_F(BuildCommand, ReportHasTheDocumentedNames) {
  const Json report = build();
  for (const char* name :
       {"output",           "sha256",       "resolution",     "bounds",      "hash_bits",
        "voxels",           "svo_nodes",    "dag_nodes",      "bytes",       "triangles",
        "dropped",          "subvolumes",   "artifacts",      "spill_bytes", "merge_passes",
        "merge_partitions", "memory_bytes", "threads",        "backend",     "stages",
        "wall_s",           "cpu_s",        "peak_rss_bytes", "voxels_per_s"})
    EXPECT_TRUE(report.contains(name)) << name;
  EXPECT_EQ(report["output"], "m.vdag");
  EXPECT_EQ(report["resolution"], 128);
  EXPECT_EQ(report["hash_bits"], 64);
  EXPECT_EQ(report["triangles"], 2112);
  EXPECT_EQ(report["bounds"]["origin"].size(), 3u);
  EXPECT_GT(report["bounds"]["edge"], 9.0);
  for (const char* name : {"outside", "invalid"}) EXPECT_EQ(report["dropped"][name], 0) << name;
  EXPECT_GT(report["subvolumes"]["total"], 0);
  for (const char* name : {"reused", "split"}) EXPECT_EQ(report["subvolumes"][name], 0) << name;
  for (const Json& stage : report["stages"])
    for (const char* name : {"name", "wall_s", "cpu_s"}) EXPECT_TRUE(stage.contains(name)) << name;
  EXPECT_EQ(report["sha256"].get<std::string>().size(), 64u);
  EXPECT_EQ(report["bytes"], contents("m.vdag").size());
  EXPECT_GT(report["voxels"], 10000);
}

// The report is also written next to the result, and the work folder is removed.
TEST_F(BuildCommand, LeavesFileAndReportOnly) {
  const Json report = build();
  EXPECT_EQ(Json::parse(contents("m.vdag.report.json")), report);
  EXPECT_FALSE(exists("m.vdag.work"));
  EXPECT_FALSE(exists("m.vdag.partial"));
  build({"--keep-work", "--work", "work"}, "n.vdag");
  EXPECT_TRUE(exists("work"));
}

// Several resolutions are built into files with the resolution in their names. Each file equals the
// file of a separate build with its resolution.
TEST_F(BuildCommand, BuildsSeveralResolutions) {
  const Json reports =
      run_json({"build", "m.glb", "-r", "32,64,128", "-o", "s.vdag", "--report", "s.json"});
  ASSERT_EQ(reports["builds"].size(), 3u);
  EXPECT_EQ(reports["builds"][1]["resolution"], 64);
  for (const char* name : {"s-32.vdag", "s-64.vdag", "s-32.json", "s-128.json"})
    EXPECT_TRUE(exists(name)) << name;
  EXPECT_FALSE(exists("s.vdag"));
  build();
  EXPECT_EQ(contents("s-128.vdag"), contents("m.vdag"));
  EXPECT_EQ(reports["builds"][2]["sha256"], Json::parse(contents("s-128.json"))["sha256"]);
  put("n-64.vdag", contents("m.vdag"));
  expect_error(2, "n-64.vdag", {"build", "m.glb", "-r", "32,64", "-o", "n.vdag"});
  EXPECT_FALSE(exists("n-32.vdag")) << "all outputs are checked first";
  for (const char* list : {"32,", "32,32", "32,33", "32;64"})
    expect_error(2, "--resolution: '" + std::string(list) + "': expected",
                 {"build", "m.glb", "-r", list, "-o", "x.vdag"});
}

// Without --json, a text report is on standard output and progress on standard error.
TEST_F(BuildCommand, PrintsATextReport) {
  const Answer answer = run({"build", "m.glb", "-r", "64", "-o", "m.vdag"});
  EXPECT_EQ(answer.status, 0);
  for (const char* part : {"m.vdag", "sha256", "triangles", "voxels", "DAG nodes"})
    EXPECT_NE(answer.out.find(part), std::string::npos) << part;
  EXPECT_NE(answer.err.find("build"), std::string::npos);
}

// Run options, such as --threads, do not change the bytes of the file. Options that select the
// geometry do.
TEST_F(BuildCommand, OnlyGeometryOptionsChangeTheBytes) {
  const std::string sha256 = build()["sha256"];
  const std::string bytes = contents("m.vdag");
  EXPECT_EQ(
      build({"--memory", "64MiB", "--threads", "1", "--subvolume", "64", "--work", "w"})["sha256"],
      sha256);
  EXPECT_EQ(contents("m.vdag"), bytes);
  EXPECT_EQ(build({"--backend", "cpu", "--force", "--restart"}, "sub/folder/n.vdag")["sha256"],
            sha256);
  EXPECT_NE(build({"--hash-bits", "8"})["sha256"], sha256);
  EXPECT_NE(build({"--voxel-size", "0.1"})["sha256"], sha256);
  const Json part = build({"--bounds", "0,0,0,4.5"});
  EXPECT_NE(part["sha256"], sha256);
  EXPECT_EQ(part["bounds"]["edge"], 4.5);
  EXPECT_GT(part["dropped"]["outside"], 0);
}

// A resolution can have the unit k, K or Ki, all of which mean 1024. Other texts are refused, and
// the error names the expected values.
TEST_F(BuildCommand, TakesResolutionsWithUnits) {
  for (const char* resolution : {"1k", "1K", "1Ki", "1024"})
    EXPECT_EQ(run_json({"build", "m.glb", "-r", resolution, "-o", "m.vdag"})["resolution"], 1024);
  for (const char* text : {"1kk", "k", "1m", "1G", "1.5k", "1 k", "1ki b", "99999999999999999999"})
    expect_error(2, "--resolution: '" + std::string(text) + "': expected a power of two from 4",
                 {"build", "m.glb", "-r", text, "-o", "x.vdag"});
  EXPECT_EQ(run_json({"extract", "m.vdag", "--resolution", "1k", "-o", "e.vdag"})["resolution"],
            1024);
  expect_error(2, "4096 or 4k", {"extract", "m.vdag", "--resolution", "k", "-o", "f.vdag"});
}

// Without a resolution, --voxel-size selects the smallest grid in which the scene fits. The edge of
// the scene, a Menger sponge, is 9.
TEST_F(BuildCommand, FindsTheResolutionOfAVoxelSize) {
  const struct {
    const char* voxel_size;
    int resolution;
  } rows[] = {{"0.05", 256}, {"0.1", 128}, {"0.0703125", 256}, {"0.0704", 128}, {"20", 4}};
  for (const auto& row : rows) {
    SCOPED_TRACE(row.voxel_size);
    const Json report =
        run_json({"build", "m.glb", "--voxel-size", row.voxel_size, "-o", "m.vdag"});
    EXPECT_EQ(report["resolution"], row.resolution);
    EXPECT_EQ(report["bounds"]["edge"], std::stod(row.voxel_size) * row.resolution);
  }
  const Json sealed = run_json({"build", "m.glb", "--voxel-size", "0.1", "--solid", "enclosed",
                                "--radius", "3", "-o", "m.vdag"});
  EXPECT_EQ(sealed["resolution"], 128);
  EXPECT_EQ(sealed["solid"]["radius"], 3);
  const std::string alone = build({"--voxel-size", "0.1"})["sha256"];
  EXPECT_EQ(run_json({"build", "m.glb", "--voxel-size", "0.1", "-o", "m.vdag"})["sha256"], alone);
  const Json plan = run_json({"plan", "m.glb", "--voxel-size", "0.05"});
  EXPECT_GT(plan["voxels"]["likely"], 10000);
  EXPECT_TRUE(plan["voxels"]["likely"].is_number_integer());
  expect_error(2, "a resolution of at least 256",
               {"build", "m.glb", "-r", "64", "--voxel-size", "0.05", "-o", "x.vdag"});
  expect_error(2, "does not fit in 2^20 voxels",
               {"build", "m.glb", "--voxel-size", "1e-7", "-o", "x.vdag"});
}

// A build replaces an earlier result of its scene, but not the result of another scene.
TEST_F(BuildCommand, KeepsResultsOfOtherScenes) {
  put("n.glb", contents("m.glb"));
  build();
  EXPECT_EQ(build({"--hash-bits", "8"})["scene"], Json::array({"m.glb"}));
  const std::vector<std::string> other = {"build", "n.glb", "-r", "64", "-o", "m.vdag"};
  const std::string bytes = contents("m.vdag");
  expect_error(2, "another scene, m.glb, and would be replaced by n.glb", other);
  EXPECT_EQ(contents("m.vdag"), bytes);
  // The same scene from another folder.
  const std::string path = folder_.path() + "/m.glb", output = folder_.path() + "/m.vdag";
  EXPECT_EQ(run({"build", path, "-r", "64", "-o", output}).status, 0);
  // Without a report next to the result, the result's scene is unknown. So the build does not
  // replace the result.
  ASSERT_EQ(run({"build", "m.glb", "-r", "64", "-o", "m.vdag", "--report", "none"}).status, 0);
  ASSERT_EQ(remove(folder_.file("m.vdag.report.json").c_str()), 0);
  expect_error(2, "no report shows that n.glb is its scene", other);
  std::vector<std::string> forced = other;
  forced.push_back("--force");
  EXPECT_EQ(run(forced).status, 0);
  EXPECT_EQ(run(other).status, 0);
}

TEST_F(BuildCommand, WritesTheReportWhereItIsWanted) {
  const Json printed = build({"--report", "none", "--solid", "enclosed"});
  EXPECT_FALSE(exists("m.vdag.report.json"));
  EXPECT_GT(printed["wall_s"], 0);
  EXPECT_FALSE(printed["stages"].empty());
  EXPECT_TRUE(printed.contains("solid"));
  const Json report = build({"--report", "reports/m.json"}, "n.vdag");
  EXPECT_FALSE(exists("n.vdag.report.json"));
  EXPECT_EQ(Json::parse(contents("reports/m.json")), report);
  build({"--report", "reports/m.json"}, "n.vdag");
  put("letter.txt", "dear");
  for (const char* path : {"letter.txt", "x.vdag", "x.vdag.partial", "-"})
    expect_error(2, path, {"build", "m.glb", "-r", "64", "-o", "x.vdag", "--report", path});
  EXPECT_EQ(contents("letter.txt"), "dear");
}

// A scene without triangles, which has the job's options, leaves the finished work of the job.
TEST_F(BuildCommand, AnEmptySceneKeepsTheWorkOfAnotherScene) {
  build({"--keep-work"});
  ASSERT_TRUE(exists("m.vdag.work/job.db"));
  put("empty.stl", "solid\nendsolid\n");
  expect_error(2, "has no triangles",
               {"build", "empty.stl", "-r", "128", "-o", "m.vdag", "--force"});
  EXPECT_TRUE(exists("m.vdag.work/job.db"));
  const std::vector<std::string> resumed = {"build", "m.glb", "-r", "128", "-o", "m.vdag"};
  EXPECT_GT(run_json(resumed)["subvolumes"]["reused"], 0);
}

// If no run of a job can succeed, its work folder is removed, so the corrected command is not
// refused because of another job in the folder.
TEST_F(BuildCommand, ACorrectedOptionNeedsNoRestart) {
  const std::vector<std::string> seeded = {"build", "m.glb",  "-r",      "64",
                                           "-o",    "s.vdag", "--solid", "enclosed"};
  const auto with = [](std::vector<std::string> command, const std::vector<std::string>& more) {
    command.insert(command.end(), more.begin(), more.end());
    return command;
  };
  expect_error(2, "the surface touches", with(seeded, {"--seed", "0,0.5,0.5"}));
  EXPECT_FALSE(exists("s.vdag.work"));
  expect_error(2, "the surface touches", with(seeded, {"--seed", "1.5,3.2,4.5", "--radius", "9"}));
  EXPECT_FALSE(exists("s.vdag.work"));
  EXPECT_EQ(run(with(seeded, {"--seed", "4.5,4.5,4.5"})).status, 0);
}

// Results are not written to the standard output, and there is no file with the name "-".
TEST_F(BuildCommand, RefusesTheStandardOutput) {
  build();
  for (const std::vector<std::string>& args :
       std::vector<std::vector<std::string>>{{"build", "m.glb", "-r", "64", "-o", "-"},
                                             {"extract", "m.vdag", "-o", "-"},
                                             {"export", "m.vdag", "--to", "npz", "-o", "-"},
                                             {"render", "m.vdag", "-o", "-"},
                                             {"generate", "menger", "-"}}) {
    SCOPED_TRACE(args[0]);
    expect_error(2, "'-': expected the name of a file", args);
  }
  EXPECT_FALSE(exists("-"));
}

// `plan` warns of a scene without triangles in the grid, which `build` refuses.
TEST_F(BuildCommand, PlansWarnOfEmptyScenes) {
  std::vector<std::string> plan = {"plan", "m.glb", "-r", "64", "--bounds", "900,900,900,1"};
  const std::string why = "triangles, all outside the grid (from 900,900,900 to 901,901,901); ";
  const Answer refused = run(plan);
  EXPECT_EQ(refused.status, 0);
  EXPECT_NE(refused.err.find(why + "a build refuses it"), std::string::npos) << refused.err;
  plan.push_back("--allow-empty");
  const Answer allowed = run(plan);
  EXPECT_NE(allowed.err.find(why + "the file will have no nodes"), std::string::npos)
      << allowed.err;
}

// A build with many triangles in a coarse grid needs memory mainly for the triangles.
TEST_F(BuildCommand, NeedsNoMoreMemoryThanPlanned) {
  if (VOXDAG_SANITIZED) GTEST_SKIP() << "sanitizers need memory";
  ASSERT_EQ(run({"generate", "soup", "s.glb", "--triangles", "1000000"}).status, 0);
  const Json plan = run_json({"plan", "s.glb", "-r", "256"});
  const Json built = run_json({"build", "s.glb", "-r", "256", "-o", "s.vdag"});
  EXPECT_GE(plan["memory_bytes"]["high"], built["peak_rss_bytes"]);
  EXPECT_LT(plan["memory_bytes"]["high"], 2 * built["peak_rss_bytes"].get<double>());
}

TEST_F(BuildCommand, IsQuiet) {
  const auto say = [&](std::vector<std::string> args) {
    args.push_back("-q");
    const Answer answer = run(args);
    EXPECT_EQ(answer.status, 0) << answer.err;
    EXPECT_EQ(answer.err, "");
    return answer.out;
  };
  const std::vector<std::vector<std::string>> commands = {
      {"build", "m.glb", "-r", "64", "-o", "m.vdag"},
      {"build", "m.glb", "-r", "16,32", "-o", "n.vdag"},
      {"verify", "m.vdag"},
      {"verify", "m.vdag", "--against", "m.glb"},
      {"render", "m.vdag", "-o", "m.png", "--size", "8x8"},
      {"extract", "m.vdag", "--level", "4", "-o", "e.vdag"},
      {"combine", "m.vdag", "--union", "m.vdag", "-o", "c.vdag"},
      {"edit", "m.vdag", "--cut", "sphere:9,9,9,9", "-o", "d.vdag"},
      {"reorder", "m.vdag", "--order", "first-parent", "-o", "r.vdag"},
      {"export", "m.vdag", "--to", "npz", "-o", "m.npz"},
      {"export", "m.vdag", "--to", "vox", "--chunks", "32", "-o", "chunks"},
      {"publish", "m.vdag", "-o", "site", "--no-poster"},
      {"publish", "--check", "site"},
      {"generate", "menger", "g.glb", "--level", "1"}};
  for (const auto& command : commands) EXPECT_EQ(say(command), "") << command[0];
  EXPECT_NE(run({"verify", "m.vdag"}).err, "");
  // `plan` and `diff` print their result.
  EXPECT_NE(say({"plan", "m.glb", "-r", "64"}), "");
  EXPECT_NE(say({"diff", "m.vdag", "m.vdag"}), "");
  EXPECT_TRUE(run_json({"verify", "m.vdag", "-q"})["ok"]);
}

// Options are read from the file that --config names. Options on the command line take precedence.
TEST_F(BuildCommand, ReadsOptionsFromAFile) {
  put("options.toml", "resolution = 32\nhash-bits = 16\n");
  const Json report = run_json({"build", "m.glb", "-o", "m.vdag", "--config", "options.toml"});
  EXPECT_EQ(report["resolution"], 32);
  EXPECT_EQ(report["hash_bits"], 16);
  EXPECT_EQ(build({"--config", "options.toml"})["resolution"], 128);
  const Json late =
      run_json({"build", "m.glb", "-o", "m.vdag", "--config", "options.toml", "-r", "64"});
  EXPECT_EQ(late["resolution"], 64);
  EXPECT_EQ(late["hash_bits"], 16);
  put("twice.toml", "# a comment\nresolution = 32\n\nhash-bits = 16\nresolution = 64\n");
  expect_error(2, "twice.toml:5: 'resolution' is given several times, first in line 2",
               {"build", "m.glb", "-o", "x.vdag", "--config", "twice.toml"});
  put("array.toml",
      "[default]\n\"attributes\" = [ # of the voxels\n  color,\n  alpha\n]\n"
      "attributes = color\nresolution = 32\n");
  expect_error(2, "array.toml:6: 'attributes' is given several times, first in line 2",
               {"build", "m.glb", "-o", "x.vdag", "--config", "array.toml"});
  put("section.toml", "threads = 2\n[x]\nthreads = 3\n");
  expect_error(2, "is not an option of build",
               {"build", "m.glb", "-o", "y.vdag", "--config", "section.toml"});
  put("wrong.toml", "resolutoin = 32\n");
  expect_error(2, "resolutoin", {"build", "m.glb", "-o", "x.vdag", "--config", "wrong.toml"});
}

// A build with an invalid value fails with an error that names the option or the limit. It leaves
// no file.
TEST_F(BuildCommand, RefusesWrongOptions) {
  const struct {
    std::vector<std::string> options;
    int status;
    const char* part;
  } rows[] = {
      {{"-r", "100"}, 2, "power of two"},
      {{"-r", "2"}, 2, "power of two"},
      {{"-r", "2097152"}, 2, "1048576"},
      {{"-r", "-64"}, 2, "resolution"},
      {{"-r", "many"}, 2, "resolution"},
      {{"-r", "64", "--memory", "63MiB"}, 2, "64MiB"},
      {{"-r", "64", "--memory", "0"}, 2, "64MiB"},
      {{"-r", "64", "--memory", "lots"}, 2, "--memory"},
      {{"-r", "64", "--memory", "-1GiB"}, 2, "--memory"},
      {{"-r", "64", "--memory", "1GiBs"}, 2, "--memory"},
      {{"-r", "64", "--threads", "x"}, 2, "'x': expected a whole number from 1 to 1024"},
      {{"-r", "64", "--threads", "-1"}, 2, "'-1': expected a whole number from 1 to 1024"},
      {{"-r", "64", "--hash-bits", "3"}, 2, "4 to 64"},
      {{"-r", "64", "--hash-bits", "65"}, 2, "4 to 64"},
      {{"-r", "64", "--subvolume", "96"}, 2, "power of two"},
      {{"-r", "64", "--subvolume", "32"}, 2, "64"},
      {{"-r", "64", "--bounds", "0,0,0"}, 2, "--bounds"},
      {{"-r", "64", "--bounds", "0,0,0,1,2"}, 2, "--bounds"},
      {{"-r", "64", "--bounds", "0,0,0,x"}, 2, "--bounds"},
      {{"-r", "64", "--bounds", "0,0,0,0"}, 2, "EDGE"},
      {{"-r", "64", "--bounds", "0,0,0,-1"}, 2, "EDGE"},
      {{"-r", "64", "--bounds", "0,nan,0,1"}, 2, "finite"},
      {{"-r", "64", "--voxel-size", "0"}, 2, "--voxel-size"},
      {{"-r", "64", "--voxel-size", "-1"}, 2, "--voxel-size"},
      {{"-r", "64", "--voxel-size", "inf"}, 2, "--voxel-size"},
      {{"-r", "64", "--voxel-size", "0.01"}, 2, "does not fit"},
      {{"-r", "64", "--voxel-size", "1", "--bounds", "0,0,0,1"}, 2, "expected one of"},
      {{"-r", "64", "--backend", "abacus"}, 2, "abacus"},
      {{"-r", "64", "--config", "none.toml"}, 3, "none.toml"},
      {{"-r", "64", "--config", "m.glb"}, 2, "m.glb"},
  };
  for (const auto& row : rows) {
    std::vector<std::string> args = {"build", "m.glb", "-o", "x.vdag"};
    args.insert(args.end(), row.options.begin(), row.options.end());
    std::string line;
    for (const std::string& word : row.options) line += word + " ";
    SCOPED_TRACE(line);
    expect_error(row.status, row.part, args);
    EXPECT_FALSE(exists("x.vdag"));
    EXPECT_FALSE(exists("x.vdag.work"));
  }
}

// Missing or invalid scenes and outputs that cannot be written are errors.
TEST_F(BuildCommand, RefusesWrongFiles) {
  expect_error(3, "none.glb", {"build", "none.glb", "-r", "64", "-o", "x.vdag"});
  expect_error(3, "none.glb", {"build", "m.glb", "none.glb", "-r", "64", "-o", "x.vdag"});
  put("text.glb", "this is not a scene");
  expect_error(2, "text.glb", {"build", "text.glb", "-r", "64", "-o", "x.vdag"});
  put("truncated.glb", contents("m.glb").substr(0, 5000));
  expect_error(2, "truncated.glb", {"build", "truncated.glb", "-r", "64", "-o", "x.vdag"});
  EXPECT_FALSE(exists("x.vdag"));
  EXPECT_FALSE(exists("x.vdag.work"));
  // An output path that leads to a folder is refused before the build starts.
  ASSERT_EQ(mkdir(folder_.file("taken").c_str(), 0777), 0);
  expect_error(2, "taken", {"build", "m.glb", "-r", "64", "-o", "taken"});
  EXPECT_FALSE(exists("taken.work"));
}

// A work folder that contains files not created by voxdag is not changed.
TEST_F(BuildCommand, LeavesForeignWorkFoldersAlone) {
  ASSERT_EQ(mkdir(folder_.file("mine").c_str(), 0777), 0);
  put("mine/letter.txt", "dear");
  expect_error(2, "mine", {"build", "m.glb", "-r", "64", "-o", "x.vdag", "--work", "mine"});
  EXPECT_EQ(contents("mine/letter.txt"), "dear");
}

}  // namespace
}  // namespace command_line
