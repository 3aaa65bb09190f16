// A glTF scene with colors from an image and from vertices. It has a bumpy sheet with an image
// whose halves are red and blue, and above it a triangle with green vertices.
#pragma once

#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "query/render/picture.h"
#include "scheduler/run_build.h"

namespace voxdag {

class PaintedScene {
 public:
  // Writes scene.gltf, its buffer and its image into the folder; returns the path.
  static std::string write(const std::string& folder, uint8_t red = 255) {
    query::Picture image(64, 32);
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        uint8_t* const pixel = image.pixel(x, y);
        pixel[0] = x < image.width / 2 ? red : 0;
        pixel[1] = 0;
        pixel[2] = x < image.width / 2 ? 0 : 255;
      }
    put(folder + "/halves.png", query::encode_png(image));
    PaintedScene scene;
    scene.add_sheet();
    scene.add_triangle();
    put(folder + "/scene.bin", scene.buffer_);
    scene.json_["buffers"] = {{{"uri", "scene.bin"}, {"byteLength", scene.buffer_.size()}}};
    put(folder + "/scene.gltf", scene.json_.dump());
    return folder + "/scene.gltf";
  }

 private:
  using Json = nlohmann::json;
  static constexpr int kCells = 40;

  PaintedScene() {
    json_ = {
        {"asset", {{"version", "2.0"}}},
        {"scenes", {{{"nodes", {0}}}}},
        {"scene", 0},
        {"nodes", {{{"mesh", 0}}}},
        {"images", {{{"uri", "halves.png"}}}},
        {"textures", {{{"source", 0}}}},
        {"materials",
         {{{"name", "sheet"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}},
          {{"name", "plain"}}}},
        {"meshes", {{{"primitives", Json::array()}}}},
        {"accessors", Json::array()},
        {"bufferViews", Json::array()}};
  }

  static void put(const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  }

  template <class T>
  int accessor(const std::vector<T>& values, const char* type, int component, size_t parts) {
    const size_t at = buffer_.size();
    buffer_.resize(at + values.size() * sizeof(T));
    std::memcpy(buffer_.data() + at, values.data(), values.size() * sizeof(T));
    const size_t bytes = values.size() * sizeof(T);
    buffer_.resize((buffer_.size() + 3) / 4 * 4);
    json_["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", at}, {"byteLength", bytes}});
    Json accessor = {{"bufferView", json_["bufferViews"].size() - 1},
                     {"componentType", component},
                     {"count", values.size() / parts},
                     {"type", type}};
    if (std::string(type) == "VEC3" && component == 5126) {
      accessor["min"] = {-9, -9, -9};
      accessor["max"] = {9, 9, 9};
    }
    json_["accessors"].push_back(accessor);
    return static_cast<int>(json_["accessors"].size()) - 1;
  }

  // Adds the sheet over x and z from 0 to 1. The image extends from left to right along x.
  void add_sheet() {
    std::vector<float> positions, coordinates;
    std::vector<uint32_t> indices;
    for (uint32_t i = 0; i <= kCells; ++i)
      for (uint32_t j = 0; j <= kCells; ++j) {
        const float x = static_cast<float>(i) / kCells, z = static_cast<float>(j) / kCells;
        const float y = static_cast<float>((i * 7 + j * 5) % 11) / 110;
        positions.insert(positions.end(), {x, y, z});
        coordinates.insert(coordinates.end(), {x, z});
        if (i == kCells || j == kCells) continue;
        const uint32_t corner = i * (kCells + 1) + j, next = corner + kCells + 1;
        indices.insert(indices.end(), {corner, next, corner + 1, corner + 1, next, next + 1});
      }
    const int position = accessor(positions, "VEC3", 5126, 3);
    const int coordinate = accessor(coordinates, "VEC2", 5126, 2);
    json_["meshes"][0]["primitives"].push_back(
        {{"attributes", {{"POSITION", position}, {"TEXCOORD_0", coordinate}}},
         {"indices", accessor(indices, "SCALAR", 5125, 1)},
         {"material", 0}});
  }

  // Adds a triangle at y = 1/2, above the middle of the sheet.
  void add_triangle() {
    const int position =
        accessor(std::vector<float>{0.25F, 0.5F, 0.25F, 0.75F, 0.5F, 0.25F, 0.5F, 0.5F, 0.75F},
                 "VEC3", 5126, 3);
    const int color = accessor(std::vector<float>{0, 1, 0, 0, 1, 0, 0, 1, 0}, "VEC3", 5126, 3);
    json_["meshes"][0]["primitives"].push_back(
        {{"attributes", {{"POSITION", position}, {"COLOR_0", color}}}, {"material", 1}});
  }

  Json json_;
  std::string buffer_;
};

inline BuildReport build_now(const BuildSpec& spec) {
  NoProgress progress;
  CancelToken cancel;
  return run_build(spec, {system_files(), progress, cancel});
}

// Returns a build of the scene that replaces the output of an earlier build.
inline BuildSpec painted_spec(const std::string& scene, const std::string& output,
                              uint64_t resolution) {
  BuildSpec spec;
  spec.geometry.scenes = {scene};
  spec.geometry.resolution = resolution;
  spec.geometry.attributes.add(Attribute::kColor);
  spec.run.output = output;
  spec.run.memory_bytes = uint64_t{256} << 20;
  spec.run.threads = 2;
  spec.run.force = true;
  return spec;
}

}  // namespace voxdag
