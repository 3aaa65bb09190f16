// A small, strict reader of the .glb files that voxdag generates. It shares no code with voxdag's
// reader, and checks the rules of glTF.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace glb {

using Point = std::array<float, 3>;
using Triangle = std::array<Point, 3>;

inline uint32_t u32(const std::string& bytes, size_t at) {
  uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

struct File {
  nlohmann::json json;
  std::string bin;

  explicit File(const std::string& bytes) {
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(u32(bytes, 4), 2u);
    EXPECT_EQ(u32(bytes, 8), bytes.size());
    const size_t json_bytes = u32(bytes, 12);
    EXPECT_EQ(u32(bytes, 16), 0x4e4f534au);
    EXPECT_EQ(json_bytes % 4, 0u);
    json = nlohmann::json::parse(bytes.substr(20, json_bytes));
    const size_t bin_head = 20 + json_bytes;
    EXPECT_EQ(u32(bytes, bin_head) + bin_head + 8, bytes.size());
    EXPECT_EQ(u32(bytes, bin_head + 4), 0x004e4942u);
    bin = bytes.substr(bin_head + 8);
    EXPECT_EQ(bin.size() % 4, 0u);
    EXPECT_EQ(json["buffers"].size(), 1u);
    EXPECT_EQ(json["buffers"][0]["byteLength"], bin.size());
    EXPECT_EQ(json["asset"]["version"], "2.0");
  }

  // Returns the elements of an accessor. Checks that the accessor is inside its view, and the view
  // inside its buffer.
  template <class Element>
  std::vector<Element> elements(size_t accessor, int component_type, const char* type) const {
    const auto& a = json["accessors"].at(accessor);
    EXPECT_EQ(a["componentType"], component_type);
    EXPECT_EQ(a["type"], type);
    const auto& view = json["bufferViews"].at(a["bufferView"].get<size_t>());
    const size_t offset = view["byteOffset"], bytes = view["byteLength"], count = a["count"];
    EXPECT_EQ(offset % 4, 0u);
    EXPECT_EQ(bytes, count * sizeof(Element));
    EXPECT_LE(offset + bytes, bin.size());
    std::vector<Element> out(count);
    std::memcpy(out.data(), bin.data() + offset, bytes);
    return out;
  }

  std::vector<Triangle> primitive(const nlohmann::json& p) const {
    const size_t accessor = p["attributes"]["POSITION"];
    const auto points = elements<Point>(accessor, 5126, "VEC3");
    for (size_t axis = 0; axis < 3; ++axis) {
      float low = points.at(0)[axis], high = low;
      for (const Point& point : points) {
        low = std::min(low, point[axis]);
        high = std::max(high, point[axis]);
      }
      EXPECT_EQ(json["accessors"][accessor]["min"][axis].get<double>(), low);
      EXPECT_EQ(json["accessors"][accessor]["max"][axis].get<double>(), high);
    }
    const auto indices = elements<uint16_t>(p["indices"], 5123, "SCALAR");
    EXPECT_EQ(indices.size() % 3, 0u);
    std::vector<Triangle> out;
    for (size_t i = 0; i + 2 < indices.size(); i += 3)
      out.push_back({points.at(indices[i]), points.at(indices[i + 1]), points.at(indices[i + 2])});
    return out;
  }

  // Returns all triangles in the space of the scene, including the triangles of instances.
  std::vector<Triangle> triangles() const {
    std::vector<Triangle> out;
    for (size_t node_index : json["scenes"][json["scene"].get<size_t>()]["nodes"]) {
      const auto& node = json["nodes"].at(node_index);
      const auto& mesh = json["meshes"].at(node["mesh"].get<size_t>());
      for (const auto& p : mesh["primitives"]) {
        const auto part = primitive(p);
        if (!node.contains("extensions")) {
          out.insert(out.end(), part.begin(), part.end());
          continue;
        }
        const auto& a = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
        const auto translations = elements<Point>(a["TRANSLATION"], 5126, "VEC3");
        const auto scales = elements<Point>(a["SCALE"], 5126, "VEC3");
        EXPECT_EQ(translations.size(), scales.size());
        for (size_t i = 0; i < translations.size(); ++i)
          for (const Triangle& t : part) out.push_back(placed(t, translations[i], scales[i]));
      }
    }
    return out;
  }

 private:
  static Triangle placed(Triangle t, const Point& translation, const Point& scale) {
    for (Point& p : t)
      for (size_t axis = 0; axis < 3; ++axis)
        p[axis] =
            static_cast<float>(static_cast<double>(p[axis]) * scale[axis] + translation[axis]);
    return t;
  }
};

}  // namespace glb
