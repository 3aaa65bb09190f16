// A scene of many quads with one image. The image is a separate file. Its transparent texels cut
// out parts of the quads.
#pragma once

#include <cstdint>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "tests/support/image_files.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag {

// Writes FOLDER/leaf.png. One of every `period` columns of texels is transparent.
inline void write_leaf_image(const std::string& folder, int period) {
  constexpr int kSize = 16;
  std::string pixels;
  for (int i = 0; i < kSize * kSize; ++i)
    pixels += std::string("\x1e\xa0\x5a", 3) + (i % kSize % period == 0 ? '\0' : '\xff');
  test::PngFormat format;
  format.width = format.height = kSize;
  std::ofstream(folder + "/leaf.png", std::ios::binary) << test::png_file(format, pixels);
}

// Writes FOLDER/leaves.glb with `quads` quads in a cube with an edge of 100. The first quad is as
// large as the cube. Returns the path of the scene.
inline std::string write_leaves(const std::string& folder, uint32_t quads) {
  std::mt19937 random(1);
  const auto number = [&](float from, float to) {
    return from + (to - from) * static_cast<float>(random() % 65536) / 65536;
  };
  std::vector<float> positions, texture;
  std::vector<uint32_t> indices;
  for (uint32_t i = 0; i < quads; ++i) {
    float corner[3], side[2][3];
    for (int a = 0; a < 3; ++a) {
      corner[a] = i == 0 ? 0 : number(1, 96);
      for (auto& s : side) s[a] = i == 0 ? 0 : number(-0.5f, 1);
    }
    if (i == 0) side[0][0] = side[1][1] = 100, side[1][2] = 30;
    for (const auto& [u, v] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
      for (int a = 0; a < 3; ++a)
        positions.push_back(corner[a] + static_cast<float>(u) * side[0][a] +
                            static_cast<float>(v) * side[1][a]);
      texture.insert(texture.end(), {static_cast<float>(u), static_cast<float>(v)});
    }
    for (const uint32_t k : {0, 1, 2, 0, 2, 3}) indices.push_back(4 * i + k);
  }
  test::SceneBuilder scene;
  const int at = scene.add_positions(positions);
  const int uv = scene.add_accessor("VEC2", test::kF32, texture);
  const int corners = scene.add_accessor("SCALAR", test::kU32, indices);
  scene.add_root({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", at}, {"TEXCOORD_0", uv}}},
                                           {"indices", corners},
                                           {"material", 0}})}});
  scene.root["images"] = {{{"uri", "leaf.png"}}};
  scene.root["textures"] = {{{"source", 0}}};
  scene.root["materials"] = {
      {{"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  std::ofstream(folder + "/leaves.glb", std::ios::binary) << scene.glb();
  return folder + "/leaves.glb";
}

}  // namespace voxdag
