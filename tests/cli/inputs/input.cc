#include "tests/cli/inputs/input.h"

namespace input_files {

std::vector<std::array<uint32_t, 3>> Mesh::triangles() const {
  std::vector<std::array<uint32_t, 3>> all;
  for (const auto& strip : strips)
    for (size_t i = 2; i < strip.size(); ++i) all.push_back({strip[i - 2], strip[i - 1], strip[i]});
  return all;
}

std::vector<float> Mesh::coordinates() const {
  std::vector<float> all;
  for (const auto& vertex : vertices) all.insert(all.end(), vertex.begin(), vertex.end());
  return all;
}

WorldTriangles Mesh::world(const oracle::WorldPoint& translation) const {
  WorldTriangles all;
  for (const auto& triangle : triangles()) {
    oracle::WorldTriangle corners;
    for (size_t k = 0; k < 3; ++k)
      for (size_t a = 0; a < 3; ++a)
        corners[k][a] = double{vertices[triangle[k]][a]} + translation[a];
    all.push_back(corners);
  }
  return all;
}

const Mesh& band() {
  static const Mesh kBand = {{{0, 0, 0},
                              {3, 1, 9},
                              {5, 0, 2},
                              {8, 2, 11},
                              {10, 1, 1},
                              {12, 3, 8},
                              {15, 2, 0},
                              {16, 5, 10},
                              {2, 6, 3},
                              {4, 12, 5},
                              {9, 7, 2},
                              {12, 13, 7}},
                             {{0, 1, 2, 3, 4, 5, 6, 7}, {8, 9, 10, 11}}};
  return kBand;
}

SceneBuilder band_scene() {
  SceneBuilder scene;
  const int positions = scene.add_positions(band().coordinates());
  std::vector<uint16_t> corners;
  for (const auto& triangle : band().triangles())
    for (const uint32_t index : triangle) corners.push_back(static_cast<uint16_t>(index));
  const int indices = scene.add_accessor("SCALAR", voxdag::test::kU16, corners);
  scene.add_root({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}},
                                           {"indices", indices}})}});
  return scene;
}

Json& only_primitive(SceneBuilder& scene) { return scene.root["meshes"][0]["primitives"][0]; }

void require_extension(SceneBuilder& scene, const std::string& name) {
  scene.root["extensionsUsed"].push_back(name);
  scene.root["extensionsRequired"].push_back(name);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (size_t at = 0; (at = text.find(from, at)) != text.npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

}  // namespace input_files
