// Tests info, verify, diff, render, plan, status and generate on small files.
#include <algorithm>
#include <cmath>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class FileCommands : public CommandLine {
 protected:
  void SetUp() override {
    make_scene();
    report_ = run_json({"build", "m.glb", "-r", "128", "-o", "m.vdag"});
  }
  Json report_;
};

TEST_F(FileCommands, InfoNamesAndCounts) {
  const Json info = run_json({"info", "m.vdag", "--digest"});
  for (const char* name :
       {"resolution", "bounds", "hash_bits", "voxels", "svo_nodes", "dag_nodes", "bytes", "sha256"})
    EXPECT_EQ(info[name], report_[name]) << name;
  ASSERT_EQ(info["levels"].size(), 6u);
  uint64_t nodes = 0;
  for (const Json& level : info["levels"]) {
    nodes += level["nodes"].get<uint64_t>();
    EXPECT_GT(level["bytes"], 0);
  }
  EXPECT_EQ(nodes, report_["dag_nodes"]);
  EXPECT_EQ(info["levels"][0]["nodes"], 1);
  EXPECT_EQ(info["levels"][5]["level"], 5);
  const Answer plain = run({"info", "m.vdag"});
  EXPECT_EQ(plain.status, 0);
  EXPECT_NE(plain.out.find("128"), std::string::npos);
}

// A valid file passes, with and without its scene. Damage gives exit status 4, or 5 if it changes
// the format version.
TEST_F(FileCommands, Verify) {
  EXPECT_EQ(run_json({"verify", "m.vdag"})["ok"], true);
  EXPECT_EQ(run_json({"verify", "m.vdag", "--against", "m.glb"})["ok"], true);
  const std::string bytes = contents("m.vdag");
  for (const size_t at : {size_t{9}, size_t{70}, size_t{5000}, bytes.size() - 1}) {
    SCOPED_TRACE(at);
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    put("damaged.vdag", damaged);
    const Answer answer = run({"verify", "damaged.vdag"});
    EXPECT_EQ(answer.status, at == 9 ? 5 : 4) << answer.err;
    EXPECT_NE(answer.err.find("damaged.vdag"), std::string::npos) << answer.err;
  }
  put("short.vdag", bytes.substr(0, bytes.size() - 1));
  expect_error(4, "short.vdag", {"verify", "short.vdag"});
}

// verify --against fails if the file was built from another scene.
TEST_F(FileCommands, VerifyAgainstAnotherScene) {
  ASSERT_EQ(run({"generate", "menger", "other.glb", "--level", "1"}).status, 0);
  const Answer answer = run({"verify", "m.vdag", "--against", "other.glb"});
  EXPECT_EQ(answer.status, 4) << answer.err;
}

// verify --against computes the colors of some regions again from the scene. They equal the file's
// colors if the file was built from this scene. With another scene, the command fails.
TEST_F(FileCommands, VerifyComparesColors) {
  for (const char* colors : {"--colors", "--json"}) {
    const std::string name = colors == std::string("--json") ? "plain.glb" : "city.glb";
    ASSERT_EQ(run({"generate", "city", name, "--triangles", "9000", colors}).status, 0);
  }
  run_json({"build", "city.glb", "-r", "256", "--color", "--attributes", "material,normal,alpha",
            "-o", "city.vdag"});
  const Json colors =
      run_json({"verify", "city.vdag", "--against", "city.glb"})["against"]["colors"];
  EXPECT_GT(colors["cells"], 1000);
  EXPECT_EQ(colors["equal"], colors["regions"]);
  const Json info = run_json({"info", "city.vdag"});
  for (const char* name : {"alpha", "normal", "material"})
    EXPECT_EQ(info["attributes"][name]["cells"], info["colors"]["cells"]) << name;
  EXPECT_GT(info["attributes"]["material"]["names"].size(), 2u);
  expect_error(2, "'alpha,shine': expected names out of color, alpha, normal, material",
               {"build", "city.glb", "-r", "64", "--attributes", "alpha,shine", "-o", "x.vdag"});
  const Answer other = run({"verify", "city.vdag", "--against", "plain.glb"});
  EXPECT_EQ(other.status, 4) << other.err;
  EXPECT_NE(other.err.find("its list of materials has 5 names, expected 1"), std::string::npos)
      << other.err;
}

// The exit status is 0 for equal files and 1 for different files. Files with different grids are an
// error.
TEST_F(FileCommands, Diff) {
  run_json({"build", "m.glb", "-r", "128", "-o", "truncated.vdag", "--hash-bits", "4"});
  const Json same = run_json({"diff", "m.vdag", "truncated.vdag"});
  EXPECT_EQ(same["same"], true);
  EXPECT_EQ(same["only_a"], 0);
  EXPECT_EQ(same["only_b"], 0);

  const std::string bounds = "0,0,0,9";
  run_json({"build", "m.glb", "-r", "64", "-o", "a.vdag", "--bounds", bounds});
  ASSERT_EQ(run({"generate", "menger", "other.glb", "--level", "1"}).status, 0);
  run_json({"build", "other.glb", "-r", "64", "-o", "b.vdag", "--bounds", bounds});
  const Answer different = run({"diff", "a.vdag", "b.vdag", "--json"});
  EXPECT_EQ(different.status, 1) << different.err;
  const Json json = Json::parse(different.out);
  EXPECT_EQ(json["same"], false);
  EXPECT_GT(json["only_a"].get<uint64_t>() + json["only_b"].get<uint64_t>(), 0u);
  expect_error(2, "", {"diff", "m.vdag", "a.vdag"});
}

// With --color, diff compares colors: two files with the same voxels but different colors are
// different, and a file is equal to its complete extract.
TEST_F(FileCommands, DiffOfColors) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  put("red.ply", head + "0 0 0 200 0 0\n1 0 0 200 0 0\n0 1 0 200 0 0\n3 0 1 2\n");
  put("blue.ply", head + "0 0 0 0 0 90\n1 0 0 0 0 90\n0 1 0 0 0 90\n3 0 1 2\n");
  for (const char* name : {"red", "blue"})
    run_json({"build", std::string(name) + ".ply", "-r", "64", "--color", "-o",
              std::string(name) + ".vdag"});
  const Json voxels = run_json({"diff", "red.vdag", "blue.vdag"});
  EXPECT_EQ(voxels["same"], true);
  EXPECT_FALSE(voxels.contains("colors"));
  const Answer different = run({"diff", "red.vdag", "blue.vdag", "--color", "--json"});
  EXPECT_EQ(different.status, 1) << different.err;
  const Json json = Json::parse(different.out);
  EXPECT_EQ(json["same"], false);
  EXPECT_EQ(json["only_a"], 0);
  const Json& colors = json["colors"];
  EXPECT_EQ(colors["resolution"], 64);
  EXPECT_EQ(colors["cells"], voxels["voxels_a"]);
  EXPECT_EQ(colors["different"], colors["cells"]);
  EXPECT_EQ(colors["largest_difference"], 200);
  EXPECT_NEAR(colors["mean_difference"].get<double>(), 290 / 3.0, 1e-9);
  EXPECT_NEAR(colors["psnr_db"].get<double>(),
              10 * std::log10(255 * 255 * 3 / (200.0 * 200 + 90 * 90)), 1e-9);
  EXPECT_NE(run({"diff", "red.vdag", "blue.vdag", "--color"}).out.find("differ, by 200 at most"),
            std::string::npos);

  const Json extracted = run_json({"extract", "red.vdag", "-o", "whole.vdag"});
  EXPECT_EQ(extracted["colors"]["resolution"], 64);
  EXPECT_EQ(extracted["colors"], run_json({"info", "red.vdag"})["colors"]);
  const Json same = run_json({"diff", "red.vdag", "whole.vdag", "--color"});
  EXPECT_EQ(same["same"], true);
  EXPECT_EQ(same["colors"]["different"], 0);
  EXPECT_TRUE(same["colors"]["psnr_db"].is_null());
  expect_error(2, "no colors", {"diff", "m.vdag", "m.vdag", "--color"});
}

// A missing file and a file of another format are different errors.
TEST_F(FileCommands, WrongFiles) {
  put("text.vdag", std::string(10000, 'x'));
  for (const char* command : {"info", "verify"}) {
    SCOPED_TRACE(command);
    expect_error(3, "none.vdag", {command, "none.vdag"});
    expect_error(4, "text.vdag", {command, "text.vdag"});
  }
  expect_error(3, "none.vdag", {"diff", "m.vdag", "none.vdag"});
  expect_error(3, "none.vdag", {"render", "none.vdag", "-o", "x.png"});
  EXPECT_FALSE(exists("x.png"));
}

TEST_F(FileCommands, RenderMakesAPicture) {
  const Json picture = run_json({"render", "m.vdag", "-o", "m.png", "--size", "64x48"});
  EXPECT_EQ(picture["width"], 64);
  EXPECT_EQ(picture["height"], 48);
  EXPECT_EQ(contents("m.png").substr(0, 8), "\x89PNG\r\n\x1a\n");
  expect_error(2, "--size", {"render", "m.vdag", "-o", "x.png", "--size", "64"});
  EXPECT_FALSE(exists("x.png"));
}

// A picture size that needs too much memory is refused before any file is read or written.
TEST_F(FileCommands, RenderRefusesWhatTakesTooMuchMemory) {
  const auto expect = [&](int status, const std::string& part, const std::string& size,
                          const std::string& memory, const std::string& option = "-o") {
    const std::string input = status == 3 ? "none.vdag" : "m.vdag";
    expect_error(status, part, {"render", input, "--size", size, "--memory", memory, option, "x"});
  };
  expect(8, "--size 16384x16384 takes 15.75 GiB of memory, expected at most 1.00 GiB",
         "16384x16384", "1GiB");
  expect(8, "or a higher --memory", "1100x1000", "64MiB");
  expect(3, "none.vdag", "1000x1000", "64MiB");
  // --depth needs less memory per pixel than a picture, so more pixels fit in 64 MiB.
  expect(8, "2900x2900 takes 64.", "2900x2900", "64MiB", "--depth");
  expect(3, "none.vdag", "2800x2900", "64MiB", "--depth");
  expect(2, "at least 64MiB", "64x64", "63MiB");
  expect(2, "--memory", "64x64", "much");
  EXPECT_FALSE(exists("x"));
  EXPECT_EQ(
      run_json({"render", "m.vdag", "-o", "x", "--size", "64x48", "--memory", "64MiB"})["width"],
      64);
}

// --depth works without -o. With both options, the distances and the picture have the same camera.
TEST_F(FileCommands, RenderMeasuresDistances) {
  const Json depth = run_json({"render", "m.vdag", "--depth", "d.npy", "--size", "64x48"});
  EXPECT_EQ(depth["depth"], "d.npy");
  EXPECT_FALSE(depth.contains("output"));
  const std::string array = contents("d.npy");
  EXPECT_NE(array.find("'shape': (48, 64)"), std::string::npos);
  EXPECT_EQ(array.size(), 128u + 4 * 64 * 48);
  expect_error(2, "--force", {"render", "m.vdag", "--depth", "d.npy", "--size", "64x48"});
  const Json both = run_json(
      {"render", "m.vdag", "--depth", "d.npy", "-o", "both.png", "--size", "64x48", "--force"});
  EXPECT_EQ(both["camera"], depth["camera"]);
  EXPECT_EQ(contents("d.npy"), array);
  EXPECT_TRUE(exists("both.png"));
  expect_error(2, "--depth", {"render", "m.vdag"});
  expect_error(2, "are both 'x.png'", {"render", "m.vdag", "-o", "x.png", "--depth", "x.png"});
}

// plan estimates a range for every value of a build, and builds nothing.
TEST_F(FileCommands, PlanNames) {
  const Json plan = run_json({"plan", "m.glb", "-r", "1024"});
  for (const char* name : {"voxels", "svo_nodes", "dag_nodes", "file_bytes", "disk_bytes",
                           "memory_bytes", "cpu_s", "wall_s"}) {
    SCOPED_TRACE(name);
    ASSERT_TRUE(plan.contains(name));
    EXPECT_LE(plan[name]["low"], plan[name]["likely"]);
    EXPECT_LE(plan[name]["likely"], plan[name]["high"]);
    EXPECT_GT(plan[name]["high"], 0);
  }
  for (const char* name : {"triangles", "subvolumes", "free_disk_bytes", "memory_budget_bytes"})
    EXPECT_GT(plan[name], 0) << name;
  EXPECT_FALSE(exists("m.glb.work"));
  for (const std::string resolution : {"4", "64", "1024"}) {
    const Json bytes = run_json({"plan", "m.glb", "-r", resolution})["file_bytes"];
    const Json built = run_json({"build", "m.glb", "-r", resolution, "-o", "m.vdag"})["bytes"];
    EXPECT_LE(bytes["low"], built) << resolution;
    EXPECT_GE(bytes["high"], built) << resolution;
  }
}

// A plan extrapolates from builds at coarse resolutions. If none of them fits in memory, there is
// no estimate.
TEST_F(FileCommands, PlanWithTooLittleMemory) {
  ASSERT_EQ(run({"generate", "soup", "soup.glb", "--triangles", "400000"}).status, 0);
  expect_error(8, "too small for an estimate, which builds the scene of 400 000 triangles",
               {"plan", "soup.glb", "-r", "32k", "--memory", "64MiB", "-q"});
}

// The plan of a solid estimates the number of voxels in its interior. It also has the warnings
// about the surface, which come from a build on a coarser grid (the pilot).
TEST_F(FileCommands, PlanOfASolid) {
  const Json solid = run_json({"plan", "m.glb", "-r", "256", "--solid", "winding"})["solid"];
  EXPECT_EQ(solid["rule"], "winding");
  EXPECT_LE(solid["interior"]["low"], solid["interior"]["high"]);
  for (const char* name : {"disputed", "rows", "open_rows", "odd_rows", "warnings"})
    EXPECT_TRUE(solid.contains(name)) << name;
  const Answer text = run({"plan", "m.glb", "-r", "256", "--solid", "enclosed"});
  EXPECT_EQ(text.status, 0);
  EXPECT_NE(text.out.find("voxels inside"), std::string::npos) << text.out;
}

// Messages about different invalid values of an option name the same range.
TEST_F(FileCommands, RangesOfNumbersAreNamedForAllValues) {
  for (const std::string threads : {"x", "0", "-1", "1.5", "1025", "99999999999999999999"})
    expect_error(2, "'" + threads + "': expected a whole number from 1 to 1024",
                 {"verify", "m.vdag", "--threads", threads});
  for (const std::string port : {"x", "-1", "65536"})
    expect_error(2, "'" + port + "': expected a whole number from 0 to 65535",
                 {"serve", "--port", port});
}

// status reports the state of the build in a work folder. The command fails if the folder does not
// exist.
TEST_F(FileCommands, StatusNames) {
  run_json({"build", "m.glb", "-r", "128", "-o", "m.vdag", "--keep-work"});
  const Json status = run_json({"status", "m.vdag.work"});
  EXPECT_EQ(status["running"], false);
  EXPECT_EQ(status["subvolumes"]["built"], status["subvolumes"]["total"]);
  for (const char* name : {"stages", "stage", "memory_bytes", "disk_bytes", "last_error"})
    EXPECT_TRUE(status.contains(name)) << name;
  EXPECT_EQ(run_json({"status", "m.vdag"}), status) << "the name of the output is enough";
  expect_error(3, "none.work", {"status", "none.work"});
  run_json({"build", "m.glb", "-r", "64", "-o", "done.vdag"});
  expect_error(3, "'voxdag info' describes a finished file", {"status", "done.vdag"});
}

// The same seed generates the same bytes, and another seed generates different bytes.
TEST_F(FileCommands, GenerateIsSeeded) {
  const auto make = [&](const std::string& kind, const std::string& seed) {
    const Json json = run_json({"generate", kind, "g.glb", "--seed", seed, "--triangles", "500"});
    EXPECT_EQ(json["kind"], kind);
    EXPECT_EQ(json["bytes"], contents("g.glb").size());
    return contents("g.glb");
  };
  for (const char* kind : {"city", "terrain", "soup", "spheres"}) {
    SCOPED_TRACE(kind);
    const std::string one = make(kind, "1");
    EXPECT_TRUE(make(kind, "1") == one);
    EXPECT_FALSE(make(kind, "2") == one);
  }
  expect_error(2, "expected one of", {"generate", "cathedral", "g.glb"});
}

// The ending of the output's name selects PNG or JPEG. An earlier picture of render is replaced
// without --force; a truncated picture is not.
TEST_F(FileCommands, RenderWritesJpeg) {
  const std::vector<std::string> render = {"render", "m.vdag", "-o", "m.JPG", "--size", "64x48"};
  run_json(render);
  EXPECT_EQ(contents("m.JPG").substr(0, 3), "\xff\xd8\xff");
  run_json(render);
  put("m.JPG", contents("m.JPG").substr(0, 20));
  expect_error(2, "--force", render);
  expect_error(2, "cannot be transparent: expected a name that ends in .png",
               {"render", "m.vdag", "-o", "x.jpeg", "--background", "transparent"});
  expect_error(2, "--background", {"render", "m.vdag", "-o", "x.png", "--background", "blue"});
  run_json({"render", "m.vdag", "-o", "t.png", "--size", "64x48", "--background", "transparent"});
  expect_error(2, "--shade", {"render", "m.vdag", "-o", "x.png", "--shade", "blue"});
  run_json({"render", "m.vdag", "-o", "s.png", "--size", "64x48", "--shade", "sharing"});
  EXPECT_EQ(contents("t.png")[25], 6) << "expected RGBA";
}

// render refuses output names with the endings of other picture formats.
TEST_F(FileCommands, RefusesNamesOfOtherPictureFormats) {
  for (const char* name : {"p.WebP", "p.tiff", "p.exr"})
    expect_error(2, "ends in .png", {"render", "x.vdag", "-o", name});
}

// The sums of the levels' node counts and bytes equal the counts and bytes of the complete file, in
// JSON and in CSV.
TEST_F(FileCommands, InfoCountsTheOctreeAndTheChildren) {
  const Json json = run_json({"info", "m.vdag", "--stats"});
  uint64_t svo_nodes = 0, dag_nodes = 0, node_bytes = 0;
  for (const Json& level : json["levels"]) {
    svo_nodes += level["svo_nodes"].get<uint64_t>();
    node_bytes += level["bytes"].get<uint64_t>();
    uint64_t nodes = 0;
    for (const Json& count : level["nodes_by_children"]) nodes += count.get<uint64_t>();
    EXPECT_EQ(nodes, level["nodes"]);
    dag_nodes += nodes;
  }
  EXPECT_EQ(svo_nodes, json["svo_nodes"]);
  EXPECT_EQ(dag_nodes, json["dag_nodes"]);
  EXPECT_EQ(node_bytes, json["node_bytes"]);
  EXPECT_GT(json["dag_nodes_2x2x2"], dag_nodes);
  EXPECT_LE(json["dag_nodes_2x2x2"], dag_nodes + 255);
  EXPECT_EQ(json["bits_per_voxel"],
            8 * static_cast<double>(node_bytes) / json["voxels"].get<double>());
  const Json files = run_json({"info", "m.vdag", "m.vdag"})["files"];
  ASSERT_EQ(files.size(), 2u);
  EXPECT_EQ(files[1]["dag_nodes"], json["dag_nodes"]);
  const std::string table = run({"info", "m.vdag", "m.vdag", "--stats", "--csv"}).out;
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 3);
  EXPECT_EQ(table.find("file,resolution,voxels,svo_nodes,dag_nodes,dag_nodes_2x2x2,bytes"), 0u);
  EXPECT_NE(table.find("\nm.vdag,128," + json["voxels"].dump() + ","), std::string::npos) << table;
  const std::string levels = run({"info", "m.vdag", "--csv", "--levels"}).out;
  EXPECT_EQ(std::count(levels.begin(), levels.end(), '\n'), 1 + json["levels"].size());
  expect_error(2, "--levels is given without --csv: expected both", {"info", "m.vdag", "--levels"});
  expect_error(2, "--csv and --json are both given: expected one of them",
               {"info", "m.vdag", "--csv", "--json"});
}

TEST_F(FileCommands, InfoFindsComponents) {
  run_json({"edit", "m.vdag", "--cut", "box:60,0,0,68,128,128", "-o", "cut.vdag"});
  const Json info = run_json({"info", "cut.vdag", "--components", "--memory", "64MiB"});
  const Json& found = info["components"];
  EXPECT_EQ(found["connectivity"], 26);
  ASSERT_GE(found["count"], 2);
  ASSERT_EQ(found["largest"].size(), std::min<size_t>(10, found["count"].get<size_t>()));
  for (const Json& component : found["largest"]) {
    EXPECT_LE(component["voxels"], found["largest"][0]["voxels"]);
    EXPECT_TRUE(component["box"][0] >= 68 || component["box"][3] <= 60) << component;
  }
  const Json by_faces =
      run_json({"info", "cut.vdag", "--components", "--connectivity", "6"})["components"];
  EXPECT_EQ(by_faces["connectivity"], 6);
  EXPECT_GE(by_faces["count"], found["count"]);
  const std::string text = run({"info", "cut.vdag", "--components"}).out;
  EXPECT_NE(text.find(" components (26 neighbors)"), std::string::npos) << text;
  const std::string table = run({"info", "cut.vdag", "--components", "--csv"}).out;
  EXPECT_NE(table.find(",components\n"), std::string::npos) << table;
  EXPECT_TRUE(table.ends_with("," + found["count"].dump() + "\n")) << table;
  expect_error(2, "expected 6 (voxels with a common face",
               {"info", "cut.vdag", "--components", "--connectivity", "18"});
  expect_error(2, "--components", {"info", "cut.vdag", "--connectivity", "6"});
}

}  // namespace
}  // namespace command_line
