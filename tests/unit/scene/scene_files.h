// Helpers for the tests of scenes: a builder of small glTF files, and functions that read the
// triangles of a scene.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "scene/formats/formats.h"
#include "scene/triangle_source.h"
#include "tests/support/memory_files.h"

namespace voxdag::test {

using Json = nlohmann::json;

inline std::string little_endian(uint32_t value) {
  std::string bytes(4, '\0');
  for (int i = 0; i < 4; ++i) bytes[static_cast<size_t>(i)] = static_cast<char>(value >> 8 * i);
  return bytes;
}

// Returns a GLB file with any JSON text and any binary chunk.
inline std::string make_glb(std::string json, std::string bin) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  bin.resize((bin.size() + 3) / 4 * 4, '\0');
  const auto size = [](const std::string& s) { return static_cast<uint32_t>(s.size()); };
  return "glTF" + little_endian(2) + little_endian(28 + size(json) + size(bin)) +
         little_endian(size(json)) + "JSON" + json + little_endian(size(bin)) +
         std::string("BIN\0", 4) + bin;
}

inline std::string base64(const std::string& bytes) {
  static const char* kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k)
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (size_t k = 0; k < 4; ++k)
      text += i + k > bytes.size() ? '=' : kAlphabet[group >> (18 - 6 * k) & 63];
  }
  return text;
}

// Component types of accessors.
enum : int { kI8 = 5120, kU8 = 5121, kI16 = 5122, kU16 = 5123, kU32 = 5125, kF32 = 5126 };

// A glTF scene that a test builds: `root` is its JSON, and `bin` is its only buffer.
struct SceneBuilder {
  Json root = {{"asset", {{"version", "2.0"}}}};
  std::string bin;

  // Appends a value to an array of the root, and returns its index.
  int add(const char* section, Json value) {
    root[section].push_back(std::move(value));
    return static_cast<int>(root[section].size()) - 1;
  }
  template <class T>
  int add_view(const std::vector<T>& values, Json more = Json::object()) {
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    more["buffer"] = 0;
    more["byteOffset"] = bin.size();
    more["byteLength"] = values.size() * sizeof(T);
    bin.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    return add("bufferViews", std::move(more));
  }
  // Adds an accessor with a separate view. `more` adds members or overrides them.
  template <class T>
  int add_accessor(const char* type, int component_type, const std::vector<T>& values,
                   Json more = Json::object()) {
    static const std::map<std::string, size_t> kComponents{
        {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
    Json accessor = {{"bufferView", add_view(values)},
                     {"componentType", component_type},
                     {"count", values.size() / kComponents.at(type)},
                     {"type", type}};
    accessor.update(more);
    return add("accessors", std::move(accessor));
  }
  int add_positions(const std::vector<float>& xyz) { return add_accessor("VEC3", kF32, xyz); }
  int add_mesh(Json primitive) {
    return add("meshes", {{"primitives", Json::array({std::move(primitive)})}});
  }
  // Adds a root node to the only scene, and returns its index.
  int add_root(Json node) {
    const int index = add("nodes", std::move(node));
    root["scene"] = 0;
    root["scenes"][0]["nodes"].push_back(index);
    return index;
  }

  std::string glb() const {
    Json whole = root;
    if (!bin.empty()) whole["buffers"] = {{{"byteLength", bin.size()}}};
    return make_glb(whole.dump(), bin);
  }
  std::string gltf(const std::string& uri) const {
    Json whole = root;
    whole["buffers"] = {{{"byteLength", bin.size()}, {"uri", uri}}};
    return whole.dump();
  }
};

// Returns a scene with the triangle (0 0 0) (1 0 0) (0 1 0), drawn by one node.
inline SceneBuilder one_triangle() {
  SceneBuilder scene;
  const int positions = scene.add_positions({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const int indices = scene.add_accessor<uint16_t>("SCALAR", kU16, {0, 1, 2});
  const int mesh =
      scene.add_mesh({{"attributes", {{"POSITION", positions}}}, {"indices", indices}});
  scene.add_root({{"mesh", mesh}});
  return scene;
}

// The coordinates x, y, z of the three corners of a triangle.
using Corners = std::array<std::array<double, 3>, 3>;

inline std::vector<Corners> triangles_of(TriangleSource& source) {
  std::vector<Corners> all;
  source.for_each_batch([&](std::span<const WorldTriangle> batch) {
    for (const WorldTriangle& t : batch) {
      Corners corners;
      for (size_t k = 0; k < 3; ++k) std::copy_n(t.v[k], 3, corners[k].begin());
      all.push_back(corners);
    }
  });
  return all;
}

// Returns the scene of one_triangle() with texture coordinates and this image as base color
// texture.
inline SceneBuilder textured(const std::string& image) {
  SceneBuilder scene = one_triangle();
  scene.root["images"] = {{{"uri", "data:image/png;base64," + base64(image)}, {"name", "wood"}}};
  scene.root["textures"] = {{{"source", 0}}};
  scene.root["materials"] = {
      {{"name", "floor"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  Json& primitive = scene.root["meshes"][0]["primitives"][0];
  primitive["material"] = 0;
  primitive["attributes"]["TEXCOORD_0"] =
      scene.add_accessor<float>("VEC2", kF32, {0, 0, 1, 0, 0.5, -2});
  return scene;
}

// Returns the surfaces of all triangles.
inline std::vector<SurfaceTriangle> surfaces_of(TriangleSource& source) {
  std::vector<SurfaceTriangle> all;
  source.open(1)->read_surfaces(0, source.declared_triangles(), [&](auto batch) {
    all.insert(all.end(), batch.begin(), batch.end());
  });
  return all;
}

inline std::vector<std::string> texts_of(const std::vector<Warning>& warnings) {
  std::vector<std::string> texts;
  for (const Warning& warning : warnings) texts.push_back(warning.text());
  return texts;
}

// A scene that is opened from a file in memory, with the objects that it needs.
struct OpenScene {
  explicit OpenScene(std::string file, SceneOptions options = {},
                     uint64_t budget_bytes = uint64_t{64} << 20)
      : budget(budget_bytes) {
    files.contents["folder/scene"] = std::move(file);
    source = open_scene(files, {"folder/scene"}, options, budget, cancel);
  }

  std::vector<Corners> triangles() { return triangles_of(*source); }

  MemoryFiles files;
  MemoryBudget budget;
  CancelToken cancel;
  std::unique_ptr<TriangleSource> source;
};

inline std::vector<Corners> triangles_of_file(std::string file) {
  return OpenScene(std::move(file)).triangles();
}

// Opens a file and reads all its triangles. Returns the error; its message is empty if there is
// none.
inline Error error_of_file(std::string file) {
  try {
    OpenScene(std::move(file)).triangles();
  } catch (const Error& e) {
    return e;
  }
  return Error(ErrorCode::kInvalidInput, "");
}

}  // namespace voxdag::test
