// glTF files with unusual vertices: skins, morph targets, strides and component types.
#include "tests/cli/inputs/input.h"

namespace input_files {
namespace {

using voxdag::test::kF32;
using voxdag::test::kU16;
using voxdag::test::kU8;

constexpr size_t kVertices = 12;
const oracle::WorldPoint kByJoint = {30, 0, 0};

WorldTriangles joined(WorldTriangles a, const WorldTriangles& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// Returns the mesh with a skin whose only joint moves it by kByJoint. `weights` has four weights
// per vertex, of the component type `type`.
template <class T>
SceneBuilder skinned(int type, const std::vector<T>& weights) {
  SceneBuilder scene = band_scene();
  Json& attributes = only_primitive(scene)["attributes"];
  attributes["JOINTS_0"] = scene.add_accessor("VEC4", kU8, std::vector<uint8_t>(4 * kVertices));
  Json more = Json::object();
  if (type != kF32) more["normalized"] = true;
  attributes["WEIGHTS_0"] = scene.add_accessor("VEC4", type, weights, more);
  const int joint = scene.add_root({{"translation", kByJoint}});
  scene.add("skins", {{"joints", {joint}}});
  scene.root["nodes"][0]["skin"] = 0;
  return scene;
}

template <class T>
std::vector<T> same_weight(T weight) {
  std::vector<T> all(4 * kVertices);
  for (size_t i = 0; i < all.size(); i += 4) all[i] = weight;
  return all;
}

// Seven vertices have no weights.
std::string without_some_weights() {
  std::vector<float> weights = same_weight(1.f);
  std::fill_n(weights.begin(), 4 * 7, 0.f);
  return skinned(kF32, weights).glb();
}

std::string with_unskinned_primitive() {
  SceneBuilder scene = skinned(kF32, same_weight(1.f));
  Json plain = only_primitive(scene);
  plain["attributes"].erase("JOINTS_0");
  plain["attributes"].erase("WEIGHTS_0");
  scene.root["meshes"][0]["primitives"].push_back(plain);
  return scene.glb();
}

// Returns the mesh with a morph target that moves the first six vertices by (0, 8, 0). With the
// weight 0.5, the result is morphed_band().
SceneBuilder morphed(const Json& weights) {
  SceneBuilder scene = band_scene();
  std::vector<float> moves(3 * kVertices);
  for (size_t i = 1; i < moves.size(); i += 3) moves[i] = i < 18 ? 8 : 0;
  only_primitive(scene)["targets"] = {{{"POSITION", scene.add_positions(moves)}}};
  scene.root["meshes"][0]["weights"] = weights;
  return scene;
}
WorldTriangles morphed_band() {
  Mesh moved = band();
  for (size_t i = 0; i < 6; ++i) moved.vertices[i][1] += 4;
  return moved.world();
}

std::string with_unmorphed_primitive() {
  SceneBuilder scene = morphed({0.5});
  Json plain = only_primitive(scene);
  plain.erase("targets");
  scene.root["meshes"][0]["primitives"].push_back(plain);
  return scene.glb();
}

std::string with_index_stride() {
  SceneBuilder scene = band_scene();
  scene.root["bufferViews"][1]["byteStride"] = 2;
  return scene.glb();
}

std::string with_stride_14() {
  SceneBuilder scene = band_scene();
  std::vector<uint16_t> bytes;
  for (const auto& vertex : band().vertices) {
    uint16_t halves[6];
    std::memcpy(halves, vertex.data(), sizeof(halves));
    bytes.insert(bytes.end(), halves, halves + 6);
    bytes.push_back(0xffff);
  }
  scene.root["accessors"][0]["bufferView"] = scene.add_view(bytes, {{"byteStride", 14}});
  return scene.glb();
}

std::string with_undeclared_integers() {
  SceneBuilder scene = band_scene();
  std::vector<uint16_t> integers;
  for (const auto& vertex : band().vertices) {
    for (const float c : vertex) integers.push_back(static_cast<uint16_t>(c));
    integers.push_back(0);
  }
  Json& accessor = scene.root["accessors"][0];
  accessor["bufferView"] = scene.add_view(integers, {{"byteStride", 8}});
  accessor["componentType"] = kU16;
  return scene.glb();
}

}  // namespace

std::vector<Input> vertex_inputs() {
  const WorldTriangles plain = band().world(), by_joint = band().world(kByJoint);
  std::vector<Input> all = {
      {"vertices without weights", without_some_weights(), {}, by_joint},
      {"sum of weights 0.5", skinned(kF32, same_weight(0.5f)).glb(), {}, by_joint},
      {"sum of weights 254 of 255", skinned(kU8, same_weight<uint8_t>(254)).glb(), {}, by_joint},
      {"primitive without joints", with_unskinned_primitive(), {}, joined(by_joint, plain)},
      {"surplus morph weights", morphed({0.5, 1}).glb(), {}, morphed_band()},
      {"primitive without targets", with_unmorphed_primitive(), {}, joined(morphed_band(), plain)},
      {"stride of indices", with_index_stride(), {}},
      {"stride of 14 bytes", with_stride_14(), {}},
      {"undeclared integers", with_undeclared_integers(), {}},
  };
  const char* warnings[] = {
      "no-weights",           "unnormalized-weights", "unnormalized-weights",
      "unskinned-primitives", "morph-weights",        "",
      "byte-stride",          "byte-stride",          "undeclared-quantization"};
  for (size_t i = 0; i < all.size(); ++i) all[i].warning = warnings[i];
  return all;
}

}  // namespace input_files
