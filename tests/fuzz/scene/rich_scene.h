// A small scene that has every feature of glTF that voxdag reads or passes over: what fuzzers start
// from.
#pragma once

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {

inline SceneBuilder rich_scene() {
  SceneBuilder scene = one_triangle();
  const int joints = scene.add_accessor<uint8_t>("VEC4", kU8, std::vector<uint8_t>(12, 0));
  const int weights = scene.add_accessor<float>("VEC4", kF32, std::vector<float>(12, 0.25f));
  Json& primitive = scene.root["meshes"][0]["primitives"][0];
  primitive["attributes"]["JOINTS_0"] = joints;
  primitive["attributes"]["WEIGHTS_0"] = weights;
  primitive["targets"] =
      Json::array({{{"POSITION", scene.add_positions(std::vector<float>(9, 1))}}});
  Json strip = primitive;
  strip["mode"] = 5;
  scene.root["meshes"][0]["primitives"].push_back(strip);
  scene.root["meshes"][0]["weights"] = {0.5};
  scene.root["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", scene.add_view<uint8_t>({2})}, {"componentType", kU8}}},
      {"values", {{"bufferView", scene.add_view<float>({0, 1, 0})}}}};
  scene.add("skins", {{"joints", {0, 1}}});
  scene.add_root({{"mesh", 0}, {"skin", 0}});
  const int translations = scene.add_positions({0, 0, 1, 0, 0, 2});
  scene.add_root(
      {{"mesh", 0},
       {"scale", {1, 2, 3}},
       {"extensions",
        {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", translations}}}}}}}});
  scene.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {1, 0.5, 0, 1}}}}}};
  scene.root["images"] = {{{"uri", "data:image/png;base64,AAAA"}}};
  scene.root["textures"] = {{{"source", 0}}};
  return scene;
}

}  // namespace voxdag::test
