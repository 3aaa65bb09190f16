#include "tests/reference/scene_file.h"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <fstream>
#include <limits>

namespace reference {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF is little-endian");

void put_word(std::ofstream& out, uint32_t word) {
  out.write(reinterpret_cast<const char*>(&word), sizeof(word));
}

std::string scene_json(size_t vertices, const float (&least)[3], const float (&most)[3]) {
  const std::string bytes = std::to_string(vertices * 12);
  const auto triple = [](const float(&v)[3]) {
    char text[80];
    std::snprintf(text, sizeof(text), "[%.9g,%.9g,%.9g]", static_cast<double>(v[0]),
                  static_cast<double>(v[1]), static_cast<double>(v[2]));
    return std::string(text);
  };
  std::string json = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],)"
                     R"("nodes":[{"mesh":0}],)"
                     R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
                     R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":)" +
                     std::to_string(vertices) + R"(,"min":)" + triple(least) + R"(,"max":)" +
                     triple(most) + R"(}],"bufferViews":[{"buffer":0,"byteLength":)" + bytes +
                     R"(}],"buffers":[{"byteLength":)" + bytes + "}]}";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  return json;
}

constexpr const char* kEmptyScene = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{}]}  )";

}  // namespace

std::vector<WorldTriangle> as_world(const Triangles& triangles) {
  std::vector<WorldTriangle> out(triangles.size());
  for (size_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < 3; ++a) out[t][i][a] = static_cast<double>(triangles[t][i][a]) / 256;
  return out;
}

std::vector<WorldTriangle> as_floats(std::vector<WorldTriangle> triangles) {
  for (WorldTriangle& t : triangles)
    for (auto& p : t)
      for (double& x : p) x = static_cast<float>(x);
  return triangles;
}

void write_glb(const std::string& path, const std::vector<WorldTriangle>& triangles, int copies) {
  constexpr float kMost = std::numeric_limits<float>::max();
  std::vector<float> positions;
  float least[3] = {kMost, kMost, kMost}, most[3] = {-kMost, -kMost, -kMost};
  for (const WorldTriangle& t : triangles)
    for (const auto& p : t)
      for (int a = 0; a < 3; ++a) {
        const float x = static_cast<float>(p[a]);
        positions.push_back(x);
        least[a] = std::min(least[a], x);
        most[a] = std::max(most[a], x);
      }
  const size_t once = positions.size() * sizeof(float);
  const size_t bytes = once * static_cast<size_t>(copies);
  const std::string json = bytes ? scene_json(bytes / 12, least, most) : std::string(kEmptyScene);

  std::ofstream out(path, std::ios::binary);
  out.exceptions(std::ios::failbit | std::ios::badbit);
  put_word(out, 0x46546c67);  // "glTF"
  put_word(out, 2);
  put_word(out, static_cast<uint32_t>(12 + 8 + json.size() + (bytes ? 8 + bytes : 0)));
  put_word(out, static_cast<uint32_t>(json.size()));
  put_word(out, 0x4e4f534a);  // "JSON"
  out << json;
  if (bytes == 0) return;
  put_word(out, static_cast<uint32_t>(bytes));
  put_word(out, 0x004e4942);  // "BIN"
  for (int i = 0; i < copies; ++i)
    out.write(reinterpret_cast<const char*>(positions.data()), static_cast<std::streamsize>(once));
}

}  // namespace reference
