// Builds each file that the other files of this folder generate. Compares the number of voxels with
// the oracle's, and all colors with the expected color.
#include <filesystem>

#include "tests/cli/command_line.h"
#include "tests/cli/inputs/input.h"
#include "tests/oracle/voxels.h"
#ifdef VOXDAG_HAS_DRACO
#include "tests/unit/scene/compressed/draco_scenes.h"
#endif

namespace input_files {
namespace {

constexpr int kResolution = 128;

uint64_t voxels_of(const Input& input) {
  const oracle::WorldCube cube = oracle::default_cube(input.triangles);
  const auto triangles = oracle::snap(input.visible.value_or(input.triangles), cube, kResolution);
  return oracle::voxelize(triangles, {{0, 0, 0}, kResolution}).count();
}

class Inputs : public command_line::CommandLine {
 protected:
  void put_all(const Input& input) {
    put("scene", input.file);
    for (const auto& [name, contents] : input.more_files) {
      std::filesystem::create_directories(std::filesystem::path(folder_.file(name)).parent_path());
      put(name, contents);
    }
  }

  void expect_color(const Color& color) {
    ASSERT_EQ(run({"export", "a.vdag", "--to", "ply", "-o", "a.ply", "--force"}).status, 0);
    const std::string file = contents("a.ply");
    const size_t begin = file.find("end_header\n") + 11;
    constexpr size_t kRow = 3 * sizeof(double) + 3;  // x, y, z, red, green, blue
    ASSERT_EQ((file.size() - begin) % kRow, 0u);
    for (size_t row = begin; row < file.size(); row += kRow)
      for (size_t c = 0; c < 3; ++c)
        ASSERT_NEAR(static_cast<unsigned char>(file[row + kRow - 3 + c]), color[c], 1);
  }

  void expect_built(const Input& input) {
    std::vector<std::string> command{"build", "scene",  "-r",     std::to_string(kResolution),
                                     "-o",    "a.vdag", "--force"};
    if (input.color) command.push_back("--color");
    const Json report = run_json(command);
    EXPECT_EQ(report["triangles"], input.triangles.size());
    EXPECT_EQ(report["voxels"], voxels_of(input));
    std::vector<std::string> codes;
    for (const Json& warning : report["warnings"]) codes.push_back(warning["code"]);
    if (input.warning.empty())
      EXPECT_EQ(codes, std::vector<std::string>{});
    else
      EXPECT_EQ(std::ranges::count(codes, input.warning), 1) << report["warnings"];
    if (input.color) expect_color(*input.color);
  }

  void check(const std::vector<Input>& inputs) {
    for (const Input& input : inputs) {
      SCOPED_TRACE(input.name);
      put_all(input);
      if (input.error.empty())
        expect_built(input);
      else
        expect_error(2, input.error, {"build", "scene", "-r", "64", "-o", "none.vdag"});
    }
  }
};

TEST_F(Inputs, PlyAsText) { check(ply_text_inputs()); }
TEST_F(Inputs, BinaryPly) { check(ply_binary_inputs()); }
TEST_F(Inputs, ConcavePolygons) { check(polygon_inputs()); }
TEST_F(Inputs, NodesAndExtensions) { check(node_inputs()); }
TEST_F(Inputs, Vertices) { check(vertex_inputs()); }
TEST_F(Inputs, Buffers) { check(buffer_inputs()); }
TEST_F(Inputs, CompressedMeshes) { check(compressed_inputs()); }
TEST_F(Inputs, Images) { check(image_inputs()); }
TEST_F(Inputs, AreRefusedByName) { check(refused_inputs()); }

#ifdef VOXDAG_HAS_DRACO
// Decoding this mesh takes more than 64 MiB, the lowest --memory. Without --memory, verify has the
// same memory as build, which suffices.
TEST_F(Inputs, LargeDracoMeshesAreVerified) {
  const auto data = voxdag::test::encode_draco(*voxdag::test::bumpy_grid(500, false),
                                               draco::MESH_EDGEBREAKER_ENCODING, 11, 10);
  put("a.glb", voxdag::test::compressed_scene_of(data).glb());
  EXPECT_EQ(run_json({"build", "a.glb", "-r", "64", "-o", "a.vdag"})["triangles"], 500000);
  EXPECT_EQ(run_json({"verify", "a.vdag", "--against", "a.glb"})["ok"], true);
  expect_error(8, "memory", {"verify", "a.vdag", "--against", "a.glb", "--memory", "64MiB"});
}
#endif

}  // namespace
}  // namespace input_files
