// Builds the same mesh from files of each format, by each command that reads scenes.
#include <cstring>

#include "tests/cli/command_line.h"
#include "tests/unit/scene/points/las_builder.h"
#include "tests/unit/scene/scene_files.h"

namespace command_line {
namespace {

// A pyramid: two triangles for its base, four for its sides.
constexpr float kCorners[][3] = {{0, 0, 0}, {8, 0, 0}, {8, 8, 0}, {0, 8, 0}, {4, 4, 6.25f}};
constexpr int kTriangles[][3] = {{0, 2, 1}, {0, 3, 2}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};

std::string corner_text(int corner) {
  std::string text;
  for (const float c : kCorners[corner]) text += " " + std::to_string(c);
  return text;
}

std::string ply() {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
      "property float z\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n";
  for (int corner = 0; corner < 5; ++corner) text += corner_text(corner) + "\n";
  for (const auto& t : kTriangles)
    text += "3 " + std::to_string(t[0]) + ' ' + std::to_string(t[1]) + ' ' + std::to_string(t[2]) +
            '\n';
  return text;
}

std::string obj() {
  std::string text = "o pyramid\n";
  for (int corner = 0; corner < 5; ++corner) text += "v" + corner_text(corner) + "\n";
  for (const auto& t : kTriangles)
    text += "f " + std::to_string(t[0] + 1) + ' ' + std::to_string(t[1] + 1) + ' ' +
            std::to_string(t[2] - 5) + '\n';
  return text;
}

std::string stl_text() {
  std::string text = "solid pyramid\n";
  for (const auto& t : kTriangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const int corner : t) text += "vertex" + corner_text(corner) + "\n";
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid pyramid\n";
}

// Returns a binary STL file whose header begins with "solid", as an ASCII file does.
std::string stl_binary() {
  std::string file = "solid but binary";
  file.resize(80);
  file += std::string("\6\0\0\0", 4);
  for (const auto& t : kTriangles) {
    file.append(12, '\0');
    for (const int corner : t)
      file.append(reinterpret_cast<const char*>(kCorners[corner]), sizeof(kCorners[corner]));
    file.append(2, '\0');
  }
  return file;
}

class MeshFormats : public CommandLine {
 protected:
  void SetUp() override {
    put("a.ply", ply());
    put("a.obj", obj());
    put("text.stl", stl_text());
    put("BINARY.STL", stl_binary());
  }
};

constexpr const char* kOtherFiles[] = {"a.obj", "text.stl", "BINARY.STL"};

TEST_F(MeshFormats, GiveTheSameBytes) {
  const Json expected = run_json({"build", "a.ply", "-r", "256", "-o", "ply.vdag"});
  EXPECT_EQ(expected["triangles"], 6);
  for (const std::string name : kOtherFiles) {
    const Json report = run_json({"build", name, "-r", "256", "-o", name + ".vdag"});
    EXPECT_EQ(report["sha256"], expected["sha256"]) << name;
    EXPECT_EQ(report["warnings"], Json::array()) << name;
    EXPECT_EQ(run_json({"verify", name + ".vdag", "--against", name})["ok"], true) << name;
  }
}

TEST_F(MeshFormats, HaveTheSamePlan) {
  const Json expected = run_json({"plan", "a.ply", "-r", "1024"});
  for (const std::string name : kOtherFiles) {
    const Json plan = run_json({"plan", name, "-r", "1024"});
    EXPECT_EQ(plan["triangles"], expected["triangles"]) << name;
    EXPECT_EQ(plan["voxels"], expected["voxels"]) << name;
  }
}

// The files of one scene can have different formats.
TEST_F(MeshFormats, AreMixedInOneScene) {
  const Json expected = run_json({"build", "a.ply", "-r", "256", "-o", "one.vdag"});
  const Json report = run_json(
      {"build", "a.ply", "a.obj", "text.stl", "BINARY.STL", "-r", "256", "-o", "all.vdag"});
  EXPECT_EQ(report["triangles"], 24);
  EXPECT_EQ(report["voxels"], expected["voxels"]);
}

struct Faulty {
  std::string name, contents;
  const char* code;
  uint64_t count;
};

std::string withheld_las() {
  voxdag::test::LasBuilder las;
  las.points = {{{0, 0, 0}, {}, false}, {{100, 200, 300}, {}, false}, {{1, 2, 3}, {}, true}};
  return las.file();
}

// Returns a scene whose mesh has a weight for a morph target that does not exist.
std::string morphed_glb() {
  voxdag::test::SceneBuilder scene = voxdag::test::one_triangle();
  scene.root["meshes"][0]["weights"] = {1};
  return scene.glb();
}

std::vector<Faulty> faulty_files() {
  const std::string header =
      "ply\nformat ascii 1.0\nMade by hand\nmore\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n";
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  return {
      {"lines.obj", triangle + "l 1 2\np 3\n", "points-or-lines", 2},
      {"pair.obj", triangle + "f 1 2\n", "degenerate-faces", 1},
      {"words.obj", triangle + "widget 3\n", "unknown-statements", 1},
      {"no.obj", "mtllib no.mtl\n" + triangle, "missing-file", 1},
      {"weights.glb", morphed_glb(), "morph-weights", 1},
      {"lines.ply", header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "ignored-line", 2},
      {"words.stl", stl_text() + "widget 3\n", "unknown-statements", 1},
      {"withheld.las", withheld_las(), "withheld-points", 1},
  };
}

// Each faulty file gives a warning with a code, the number of faults, and the place of the first
// fault. With --strict the build fails instead.
TEST_F(MeshFormats, ReportWarnings) {
  for (const Faulty& file : faulty_files()) {
    SCOPED_TRACE(file.name);
    put(file.name, file.contents);
    const std::string output = file.name + ".vdag";
    const Answer answer = run({"build", file.name, "-r", "64", "--color", "--json", "-o", output});
    EXPECT_NE(answer.err.find("warning"), std::string::npos) << answer.err;
    Json warnings = Json::parse(answer.out)["warnings"];
    std::erase_if(warnings.get_ref<Json::array_t&>(),
                  [](const Json& warning) { return warning["code"] == "no-colors"; });
    ASSERT_EQ(warnings.size(), 1u) << warnings;
    EXPECT_EQ(warnings[0]["code"], file.code);
    EXPECT_EQ(warnings[0]["count"], file.count);
    EXPECT_NE(warnings[0]["place"], "") << warnings;
    expect_error(2, file.name,
                 {"build", file.name, "-r", "64", "--color", "--strict", "-o", "strict.vdag"});
    EXPECT_FALSE(exists("strict.vdag"));
  }
}

}  // namespace
}  // namespace command_line
