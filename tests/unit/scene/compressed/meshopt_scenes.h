// Scenes with EXT_meshopt_compression, and their forms with KHR_meshopt_compression.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tests/unit/scene/scene_files.h"

#ifdef VOXDAG_HAS_MESHOPT
#include <meshoptimizer.h>
#endif

namespace voxdag::test {

// Adds a view whose compressed data is `bytes`. The view itself refers to buffer 1, which
// meshopt_glb() and khr_meshopt_glb() declare as a fallback buffer without data.
inline int add_compressed(SceneBuilder& scene, const std::vector<unsigned char>& bytes,
                          size_t count, size_t stride, const char* mode,
                          Json more = Json::object()) {
  const int from = scene.add_view(bytes);
  const Json source = scene.root["bufferViews"][static_cast<size_t>(from)];
  Json extension = {{"buffer", 0},
                    {"byteOffset", source["byteOffset"]},
                    {"byteLength", bytes.size()},
                    {"byteStride", stride},
                    {"count", count},
                    {"mode", mode}};
  extension.update(more);
  Json view = {{"buffer", 1},
               {"byteLength", count * stride},
               {"extensions", {{"EXT_meshopt_compression", extension}}}};
  if (std::string(mode) == "ATTRIBUTES") view["byteStride"] = stride;
  return scene.add("bufferViews", std::move(view));
}

inline std::string meshopt_glb(const SceneBuilder& scene) {
  Json whole = scene.root;
  whole["buffers"] = {{{"byteLength", scene.bin.size()}},
                      {{"byteLength", 1 << 30},
                       {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  whole["extensionsUsed"].push_back("EXT_meshopt_compression");
  whole["extensionsRequired"] = {"EXT_meshopt_compression"};
  return make_glb(whole.dump(), scene.bin);
}

// Returns a GLB of the scene that uses KHR_meshopt_compression instead of EXT_meshopt_compression.
inline std::string khr_meshopt_glb(const SceneBuilder& scene) {
  SceneBuilder khr = scene;
  for (Json& view : khr.root["bufferViews"]) {
    if (!view.contains("extensions")) continue;
    const Json extension = view["extensions"]["EXT_meshopt_compression"];
    view["extensions"] = {{"KHR_meshopt_compression", extension}};
  }
  khr.root["buffers"] = {{{"byteLength", scene.bin.size()}},
                         {{"byteLength", 1 << 30},
                          {"extensions", {{"KHR_meshopt_compression", {{"fallback", true}}}}}}};
  khr.root["extensionsUsed"].push_back("KHR_meshopt_compression");
  khr.root["extensionsRequired"] = {"KHR_meshopt_compression"};
  return make_glb(khr.root.dump(), scene.bin);
}

inline int add_accessor_of(SceneBuilder& scene, int view, int type, size_t count,
                           const char* shape) {
  return scene.add(
      "accessors",
      {{"bufferView", view}, {"componentType", type}, {"count", count}, {"type", shape}});
}

inline void draw(SceneBuilder& scene, int positions, int indices, int mode = 4) {
  scene.add_root({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}},
                                           {"indices", indices},
                                           {"mode", mode}})}});
}

#ifdef VOXDAG_HAS_MESHOPT

template <class T>
std::vector<unsigned char> encode_vertices(const std::vector<T>& values, size_t stride) {
  const size_t count = values.size() * sizeof(T) / stride;
  std::vector<unsigned char> out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), values.data(), count, stride));
  return out;
}

#endif

}  // namespace voxdag::test
