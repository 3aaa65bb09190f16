// Files as other programs write them, with the voxels that they must give or the error that they
// must cause. Each file is generated here. Most files store the same mesh.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tests/oracle/grid.h"
#include "tests/unit/scene/scene_files.h"

namespace input_files {

using voxdag::test::Json;
using voxdag::test::SceneBuilder;
using WorldTriangles = std::vector<oracle::WorldTriangle>;

// A mesh of two strips. All coordinates are small integers, so that every encoding is exact.
struct Mesh {
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::vector<uint32_t>> strips;

  // Returns the vertex indices of all triangles, strip after strip.
  std::vector<std::array<uint32_t, 3>> triangles() const;
  // Returns x, y and z of all vertices, one vertex after the other.
  std::vector<float> coordinates() const;
  WorldTriangles world(const oracle::WorldPoint& translation = {0, 0, 0}) const;
};
const Mesh& band();

using Color = std::array<int, 3>;
// The expected colors of the files that have a color.
constexpr Color kRed{200, 60, 20}, kGreen{30, 160, 90};

struct Input {
  std::string name;
  std::string file;                               // the scene
  std::map<std::string, std::string> more_files;  // files that the scene refers to
  WorldTriangles triangles = band().world();      // the scene's triangles
  // The triangles whose voxels the build must set; nullopt if these are all `triangles`.
  std::optional<WorldTriangles> visible = {};
  std::optional<Color> color = {};  // expected color of all cells; nullopt: built without --color
  std::string warning = "";         // code of a warning that must occur once; "" for none
  std::string error = "";           // part of the message if the build must fail; else ""
};

std::vector<Input> ply_text_inputs();
std::vector<Input> ply_binary_inputs();
std::vector<Input> polygon_inputs();
std::vector<Input> node_inputs();
std::vector<Input> vertex_inputs();
std::vector<Input> buffer_inputs();
std::vector<Input> compressed_inputs();
std::vector<Input> image_inputs();
std::vector<Input> refused_inputs();

// Returns a scene with one node, which draws the mesh as triangles with 16-bit indices.
SceneBuilder band_scene();
Json& only_primitive(SceneBuilder& scene);
void require_extension(SceneBuilder& scene, const std::string& name);

std::string replaced(std::string text, const std::string& from, const std::string& to);

}  // namespace input_files
