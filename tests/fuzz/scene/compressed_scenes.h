// Small scenes with compressed geometry for the corpus of the fuzzers, one for each compression
// that voxdag decodes. Scenes whose library is missing are left out.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tests/unit/scene/compressed/draco_scenes.h"
#include "tests/unit/scene/compressed/meshopt_scenes.h"
#include "tests/unit/scene/compressed/vertex_stream_writer.h"

namespace voxdag::test {

// Returns the contents of the scenes' files by name.
inline std::map<std::string, std::string> compressed_scenes() {
  std::map<std::string, std::string> files;
#ifdef VOXDAG_HAS_DRACO
  struct Input {
    const char* name;
    uint32_t edge;
    bool with_normals;
    int method, quantization_bits;
  };
  for (const auto& [name, edge, with_normals, method, bits] :
       {Input{"draco_sequential", 3, false, draco::MESH_SEQUENTIAL_ENCODING, 0},
        Input{"draco_sequential_quantized", 3, true, draco::MESH_SEQUENTIAL_ENCODING, 8},
        Input{"draco_edgebreaker", 4, false, draco::MESH_EDGEBREAKER_ENCODING, 0},
        Input{"draco_edgebreaker_quantized", 4, true, draco::MESH_EDGEBREAKER_ENCODING, 10},
        Input{"draco_edgebreaker_many", 12, true, draco::MESH_EDGEBREAKER_ENCODING, 6}}) {
    files[std::string(name) + ".glb"] =
        compressed_scene_of(encode_draco(*bumpy_grid(edge, with_normals), method, bits)).glb();
  }
#endif
#ifdef VOXDAG_HAS_MESHOPT
  const std::vector<uint32_t> corners = {0, 1, 2, 1, 3, 2};
  const auto add = [&](const char* name, const std::vector<unsigned char>& vertices, Json filter,
                       bool is_strip) {
    SceneBuilder scene;
    const size_t count = is_strip ? 4 : corners.size();
    std::vector<unsigned char> indices(256);
    indices.resize(
        is_strip
            ? meshopt_encodeIndexSequence(indices.data(), indices.size(), corners.data(), count)
            : meshopt_encodeIndexBuffer(indices.data(), indices.size(), corners.data(), count));
    const int p = add_compressed(scene, vertices, 4, 12, "ATTRIBUTES", std::move(filter));
    const int i = add_compressed(scene, indices, count, 4, is_strip ? "INDICES" : "TRIANGLES");
    draw(scene, add_accessor_of(scene, p, kF32, 4, "VEC3"),
         add_accessor_of(scene, i, kU32, count, "SCALAR"), is_strip ? 5 : 4);
    files[std::string(name) + ".glb"] = meshopt_glb(scene);
  };
  const std::vector<float> square = {0, 0, 0, 1, 0, 0.5, 0, 1, 0.25, 1, 1, 2};
  const std::vector<uint32_t> exponents = {0x00000001, 0xff000003, 0xfe000007, 0x01fffffe,
                                           0x00000010, 0xff000100, 0xfe000070, 0x01ffff00,
                                           0x02000001, 0xf0000003, 0xf1000007, 0x00fffffe};
  add("meshopt_triangles", encode_vertices(square, 12), Json::object(), false);
  add("meshopt_strip", encode_vertices(square, 12), Json::object(), true);
  add("meshopt_exponential", encode_vertices(exponents, 12), {{"filter", "EXPONENTIAL"}}, false);
  const std::string bytes(reinterpret_cast<const char*>(square.data()),
                          square.size() * sizeof(float));
  add("meshopt_version_1", write_vertex_stream_1(bytes, 12, {0x42, 1, 0}, 1), Json::object(),
      false);
#endif
  return files;
}

}  // namespace voxdag::test
