// A small scene from which fuzzers start. It has every feature of glTF that voxdag reads or skips.
#pragma once

#include "core/image/png_writer.h"
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
  return scene;
}

// Returns rich_scene() with materials, images, colors and texture coordinates.
inline SceneBuilder rich_painted_scene() {
  SceneBuilder scene = rich_scene();
  Json& primitives = scene.root["meshes"][0]["primitives"];
  Json& list = primitives[0]["attributes"];
  list["COLOR_0"] =
      scene.add_accessor<uint8_t>("VEC3", kU8, {1, 2, 3, 4, 5, 6, 7, 8, 9}, {{"normalized", true}});
  list["TEXCOORD_0"] = scene.add_accessor<float>("VEC2", kF32, {0, 0, 1, 0, 0.5, -2});
  list["TEXCOORD_1"] =
      scene.add_accessor<uint16_t>("VEC2", kU16, {0, 1, 2, 3, 4, 65535}, {{"normalized", true}});
  scene.root["accessors"][list["TEXCOORD_0"].get<size_t>()]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", scene.add_view<uint8_t>({1})}, {"componentType", kU8}}},
      {"values", {{"bufferView", scene.add_view<float>({3, 4})}}}};
  primitives[0]["material"] = 0;
  primitives[1]["attributes"]["TEXCOORD_0"] = list["TEXCOORD_0"];
  primitives[1]["material"] = 1;
  const std::string png = encode_png(3, 2, std::vector<uint8_t>(18, 77));
  scene.root["images"] = {
      {{"bufferView", scene.add_view(std::vector<uint8_t>(png.begin(), png.end()))}},
      {{"uri", "data:image/png;base64," + base64(png)}}};
  scene.root["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}}};
  scene.root["textures"] = {{{"source", 0}, {"sampler", 0}}, {{"source", 1}}};
  const Json transform = {{"offset", {0.5, 7}}, {"rotation", 1.5}, {"scale", {2, 3}}};
  const Json use = {
      {"index", 0}, {"texCoord", 1}, {"extensions", {{"KHR_texture_transform", transform}}}};
  scene.root["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorFactor", {1, 0.5, 0, 1}}, {"baseColorTexture", use}}},
       {"alphaMode", "MASK"},
       {"alphaCutoff", 0.25}},
      {{"extensions",
        {{"KHR_materials_pbrSpecularGlossiness",
          {{"diffuseFactor", {1, 1, 1, 1}}, {"diffuseTexture", {{"index", 1}}}}}}}}};
  return scene;
}

}  // namespace voxdag::test
