// Scenes with KHR_draco_mesh_compression, and meshes for them.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "tests/unit/scene/scene_files.h"

#ifdef VOXDAG_HAS_DRACO
#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#endif

namespace voxdag::test {

inline Json draco_extension(int view, Json attributes) {
  return {{"KHR_draco_mesh_compression",
           {{"bufferView", view}, {"attributes", std::move(attributes)}}}};
}

// Returns a scene with one primitive whose Draco data is `data`. `vertices` and `indices` are the
// counts that its accessors declare.
inline SceneBuilder compressed_scene(const std::vector<char>& data, uint64_t vertices,
                                     uint64_t indices, Json attributes = {{"POSITION", 0}}) {
  SceneBuilder scene;
  const int view = scene.add_view(data);
  const int positions =
      scene.add("accessors", {{"componentType", kF32}, {"count", vertices}, {"type", "VEC3"}});
  const int corners =
      scene.add("accessors", {{"componentType", kU16}, {"count", indices}, {"type", "SCALAR"}});
  const int mesh = scene.add_mesh({{"attributes", {{"POSITION", positions}}},
                                   {"indices", corners},
                                   {"extensions", draco_extension(view, std::move(attributes))}});
  scene.add_root({{"mesh", mesh}});
  scene.root["extensionsUsed"] = {"KHR_draco_mesh_compression"};
  scene.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return scene;
}

#ifdef VOXDAG_HAS_DRACO

// Returns a bumpy grid of 2 * n * n triangles. With `with_normals`, each face has its own
// normal.
inline std::unique_ptr<draco::Mesh> bumpy_grid(uint32_t n, bool with_normals) {
  auto mesh = std::make_unique<draco::Mesh>();
  const uint32_t points = with_normals ? 6 * n * n : (n + 1) * (n + 1);
  mesh->set_num_points(points);
  draco::GeometryAttribute position, normal;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, 12, 0);
  normal.Init(draco::GeometryAttribute::NORMAL, nullptr, 3, draco::DT_FLOAT32, false, 12, 0);
  const int positions = mesh->AddAttribute(position, true, points);
  const int normals = with_normals ? mesh->AddAttribute(normal, true, points) : -1;
  std::mt19937 random(7);
  std::vector<float> height((n + 1) * (n + 1));
  for (float& h : height) h = static_cast<float>(random() % 1000) / 300;
  const auto set = [&](uint32_t point, uint32_t x, uint32_t y, uint32_t face) {
    const float at[3] = {static_cast<float>(x) * 1.37f, static_cast<float>(y),
                         height[y * (n + 1) + x]};
    mesh->attribute(positions)->SetAttributeValue(draco::AttributeValueIndex(point), at);
    const float direction[3] = {face % 2 ? 1.f : 0.f, face % 3 ? 0.f : 1.f, 1.f};
    if (with_normals)
      mesh->attribute(normals)->SetAttributeValue(draco::AttributeValueIndex(point), direction);
  };
  uint32_t face = 0;
  for (uint32_t y = 0; y < n; ++y) {
    for (uint32_t x = 0; x < n; ++x) {
      const uint32_t corners[2][3][2] = {{{x, y}, {x + 1, y}, {x, y + 1}},
                                         {{x + 1, y}, {x + 1, y + 1}, {x, y + 1}}};
      for (const auto& triangle : corners) {
        draco::Mesh::Face indices;
        for (uint32_t k = 0; k < 3; ++k) {
          const auto [cx, cy] = std::pair(triangle[k][0], triangle[k][1]);
          const uint32_t point = with_normals ? 3 * face + k : cy * (n + 1) + cx;
          set(point, cx, cy, face);
          indices[k] = point;
        }
        mesh->AddFace(indices);
        ++face;
      }
    }
  }
  if (with_normals) {
    mesh->DeduplicateAttributeValues();
    mesh->DeduplicatePointIds();
  }
  return mesh;
}

// Returns the compressed mesh. `method` is a MeshEncoderMethod of Draco. `speed` is from 0 to 10;
// at low speeds, the encoder uses more kinds of prediction.
inline std::vector<char> encode_draco(const draco::Mesh& mesh, int method, int quantization_bits,
                                      int speed = 5) {
  draco::ExpertEncoder encoder(mesh);
  encoder.SetEncodingMethod(method);
  encoder.SetSpeedOptions(speed, speed);
  for (int i = 0; quantization_bits > 0 && i < mesh.num_attributes(); ++i)
    if (i == 0 || mesh.attribute(i)->data_type() == draco::DT_FLOAT32)
      encoder.SetAttributeQuantization(i, quantization_bits);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeToBuffer(&buffer).ok());
  return {buffer.data(), buffer.data() + buffer.size()};
}

inline std::unique_ptr<draco::Mesh> decode_draco(const std::vector<char>& data) {
  draco::DecoderBuffer buffer;
  buffer.Init(data.data(), data.size());
  draco::Decoder decoder;
  return std::move(decoder.DecodeMeshFromBuffer(&buffer)).value();
}

inline SceneBuilder compressed_scene_of(const std::vector<char>& data) {
  const auto mesh = decode_draco(data);
  return compressed_scene(data, mesh->num_points(), 3 * mesh->num_faces());
}

#endif

}  // namespace voxdag::test
