// Primitives that break rules of glTF, but whose triangles are clear, are read; a warning names
// them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

const std::vector<float> kTriangle = {0, 0, 0, 1, 0, 0, 0, 1, 0};
const Corners kAtRest = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};

Corners moved(Corners corners, double x, double y, double z) {
  for (auto& corner : corners) corner = {corner[0] + x, corner[1] + y, corner[2] + z};
  return corners;
}

Json& primitives_of(SceneBuilder& scene, size_t mesh = 0) {
  return scene.root["meshes"][mesh]["primitives"];
}

// Expects these triangles, and one warning with this code and count; no warning if `code` is "".
void expect_scene(const std::string& file, const std::vector<Corners>& triangles,
                  const std::string& code, uint64_t count = 1) {
  OpenScene open(file);
  EXPECT_EQ(open.triangles(), triangles);
  const std::vector<Warning> warnings = open.source->warnings();
  ASSERT_EQ(warnings.size(), code.empty() ? 0u : 1u);
  if (code.empty()) return;
  EXPECT_EQ(warnings[0].code, code);
  EXPECT_EQ(warnings[0].count, count);
}

TEST(GltfPrimitives, WithoutPositionsAreIgnored) {
  for (const int mode : {4, 5, 6}) {
    SceneBuilder scene = one_triangle();
    const Json bare = {{"attributes", {{"NORMAL", 0}}}, {"indices", 1}, {"mode", mode}};
    primitives_of(scene).insert(primitives_of(scene).begin(), bare);
    primitives_of(scene).push_back({{"attributes", Json::object()}});
    expect_scene(scene.glb(), {kAtRest}, "no-positions", 2);
    scene.add_root({{"mesh", scene.add_mesh(bare)}});
    expect_scene(scene.glb(), {kAtRest}, "no-positions", 3);
  }
}

TEST(GltfPrimitives, PointsAndLinesAreCountedByPrimitive) {
  SceneBuilder scene = one_triangle();
  for (int mode = 0; mode < 4; ++mode)
    primitives_of(scene).push_back({{"attributes", {{"POSITION", 99}}}, {"mode", mode}});
  scene.add_root({{"mesh", 0}, {"translation", {5, 0, 0}}});
  expect_scene(scene.glb(), {kAtRest, moved(kAtRest, 5, 0, 0)}, "points-or-lines", 4);
}

// Returns one_triangle() with a morph target that moves all vertices by (0 0 1), and with these
// weights.
SceneBuilder morphed(const std::vector<double>& weights) {
  SceneBuilder scene = one_triangle();
  const int up = scene.add_positions({0, 0, 1, 0, 0, 1, 0, 0, 1});
  primitives_of(scene)[0]["targets"] = {{{"POSITION", up}}};
  scene.root["meshes"][0]["weights"] = weights;
  return scene;
}

TEST(GltfPrimitives, SurplusMorphWeightsAreIgnored) {
  expect_scene(morphed({0.5}).glb(), {moved(kAtRest, 0, 0, 0.5)}, "");
  expect_scene(morphed({0.5, 0.25, 8}).glb(), {moved(kAtRest, 0, 0, 0.5)}, "morph-weights");
  SceneBuilder by_node = morphed({0.5});
  by_node.root["nodes"][0]["weights"] = {2, 3};
  expect_scene(by_node.glb(), {moved(kAtRest, 0, 0, 2)}, "morph-weights");
  SceneBuilder without_targets = one_triangle();
  without_targets.root["meshes"][0]["weights"] = {1};
  expect_scene(without_targets.glb(), {kAtRest}, "morph-weights");
}

TEST(GltfPrimitives, MissingMorphWeightsAreZero) {
  SceneBuilder scene = morphed({0.5});
  primitives_of(scene)[0]["targets"].push_back({{"POSITION", 2}});
  expect_scene(scene.glb(), {moved(kAtRest, 0, 0, 0.5)}, "morph-weights");
}

TEST(GltfPrimitives, WithoutTargetsBesideMorphedOnes) {
  for (const bool is_first : {false, true}) {
    SceneBuilder scene = morphed({0.5});
    Json plain = {{"attributes", {{"POSITION", 0}}}};
    primitives_of(scene).insert(
        is_first ? primitives_of(scene).begin() : primitives_of(scene).end(), plain);
    const Corners morphed = moved(kAtRest, 0, 0, 0.5);
    expect_scene(scene.glb(),
                 is_first ? std::vector{kAtRest, morphed} : std::vector{morphed, kAtRest}, "");
  }
}

// Returns one_triangle() with a skin of one joint that is at (10 0 0). The node with the mesh is at
// (0 0 7), which must have no effect on skinned vertices.
SceneBuilder skinned() {
  SceneBuilder scene = one_triangle();
  Json& attributes = primitives_of(scene)[0]["attributes"];
  attributes["JOINTS_0"] =
      scene.add_accessor<uint8_t>("VEC4", kU8, {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  attributes["WEIGHTS_0"] =
      scene.add_accessor<float>("VEC4", kF32, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const int joint = scene.add_root({{"translation", {10, 0, 0}}});
  scene.add("skins", {{"joints", {joint}}});
  scene.root["nodes"][0]["skin"] = 0;
  scene.root["nodes"][0]["translation"] = {0, 0, 7};
  return scene;
}

// A primitive without joints is placed by its node, as if the node had no skin.
TEST(GltfPrimitives, WithoutJointsBesideSkinnedOnes) {
  const Corners by_joint = moved(kAtRest, 10, 0, 0), by_node = moved(kAtRest, 0, 0, 7);
  expect_scene(skinned().glb(), {by_joint}, "");
  SceneBuilder scene = skinned();
  const Json plain = {{"attributes", {{"POSITION", 0}}}};
  const Json skinned_primitive = primitives_of(scene)[0];
  primitives_of(scene) = {skinned_primitive, plain, skinned_primitive, plain};
  expect_scene(scene.glb(), {by_joint, by_node, by_joint, by_node}, "unskinned-primitives", 2);
  primitives_of(scene) = Json::array({plain});
  expect_scene(scene.glb(), {by_node}, "unskinned-primitives");
}

// Returns skinned() with other weights.
template <class T>
SceneBuilder weighted(int type, const std::vector<T>& weights, bool is_normalized) {
  SceneBuilder scene = skinned();
  Json more = Json::object();
  if (is_normalized) more["normalized"] = true;
  primitives_of(scene)[0]["attributes"]["WEIGHTS_0"] =
      scene.add_accessor("VEC4", type, weights, more);
  return scene;
}

template <class T>
std::vector<T> per_vertex(T a, T b, T c = 0, T d = 0) {
  return {a, b, c, d, a, b, c, d, a, b, c, d};
}

TEST(GltfPrimitives, WeightsAreDividedByTheirSum) {
  const std::vector<Corners> expected = {moved(kAtRest, 10, 0, 0)};
  const auto expect = [&](const SceneBuilder& scene, const char* code) {
    expect_scene(scene.glb(), expected, code, *code ? 3 : 0);
  };
  expect(weighted<float>(kF32, per_vertex(0.5f, 0.f), false), "unnormalized-weights");
  expect(weighted<float>(kF32, per_vertex(2.f, 1.f, 1.f), false), "unnormalized-weights");
  expect(weighted<float>(kF32, per_vertex(0.f, 0.f, 0.f, 1e-3f), false), "unnormalized-weights");
  expect(weighted<uint8_t>(kU8, per_vertex<uint8_t>(127, 127), true), "unnormalized-weights");
  expect(weighted<uint8_t>(kU8, per_vertex<uint8_t>(128, 128), true), "unnormalized-weights");
  expect(weighted<uint8_t>(kU8, per_vertex<uint8_t>(128, 127), true), "");
  expect(weighted<uint8_t>(kU8, per_vertex<uint8_t>(64, 64, 64, 63), true), "");
  expect(weighted<uint16_t>(kU16, per_vertex<uint16_t>(32767, 32767), true),
         "unnormalized-weights");
  expect(weighted<uint16_t>(kU16, per_vertex<uint16_t>(65535, 0), true), "");
  // Integer weights without the flag "normalized".
  expect(weighted<uint8_t>(kU8, per_vertex<uint8_t>(255, 0), false), "unnormalized-weights");
  expect(weighted<uint16_t>(kU16, per_vertex<uint16_t>(128, 128), false), "unnormalized-weights");
}

// A vertex can have several sets of weights (WEIGHTS_0, WEIGHTS_1). Only the sum over all sets must
// be 1.
TEST(GltfPrimitives, WeightsOfSeveralSetsAreOneSum) {
  SceneBuilder scene = weighted<float>(kF32, per_vertex(0.25f, 0.25f), false);
  Json& attributes = primitives_of(scene)[0]["attributes"];
  attributes["JOINTS_1"] = attributes["JOINTS_0"];
  attributes["WEIGHTS_1"] = attributes["WEIGHTS_0"];
  const std::vector<Corners> expected = {moved(kAtRest, 10, 0, 0)};
  expect_scene(scene.glb(), expected, "");
  attributes["WEIGHTS_1"] = scene.add_accessor<float>("VEC4", kF32, per_vertex(0.f, 0.f));
  expect_scene(scene.glb(), expected, "unnormalized-weights", 3);
}

// If the sum of a vertex's weights differs from 1 only by rounding, the weights are used unchanged.
TEST(GltfPrimitives, RoundedWeightsAreUsedUnchanged) {
  const float third = 1.f / 3;
  const double sum = 3 * static_cast<double>(third);
  ASSERT_NE(sum, 1);
  const auto triangles =
      triangles_of_file(weighted<float>(kF32, per_vertex(third, third, third), false).glb());
  EXPECT_EQ(triangles[0][1][0], sum + 10 * sum);
}

TEST(GltfPrimitives, TheFirstJointMovesVerticesWithoutWeights) {
  const std::vector<float> weights = {0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0};
  SceneBuilder scene = weighted(kF32, weights, false);
  expect_scene(scene.glb(), {moved(kAtRest, 10, 0, 0)}, "no-weights", 2);
  const int joint = scene.add_root({{"translation", {0, 20, 0}}});
  scene.root["skins"][0]["joints"].push_back(joint);
  primitives_of(scene)[0]["attributes"]["JOINTS_0"] =
      scene.add_accessor<uint8_t>("VEC4", kU8, {0, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0});
  expect_scene(scene.glb(), {{{{10, 0, 0}, {1, 20, 0}, {0, 21, 0}}}}, "no-weights", 2);
  scene.root["skins"][0]["joints"] = {joint};
  EXPECT_THAT(error_of_file(scene.glb()).message(), testing::HasSubstr("is not a finite position"));
}

// Joint weights are ignored, even if invalid, if the node has no skin.
TEST(GltfPrimitives, WeightsWithoutASkinAreIgnored) {
  SceneBuilder scene = weighted<float>(kF32, per_vertex(0.f, 0.f), false);
  scene.root["nodes"][0].erase("skin");
  expect_scene(scene.glb(), {moved(kAtRest, 0, 0, 7)}, "");
}

// Faults of meshes, skins and nodes that the scene does not draw are not errors.
TEST(GltfPrimitives, UnusedOnesMayBeBroken) {
  const Json kBroken[] = {{{"attributes", {{"POSITION", 77}}}},
                          {{"attributes", {{"POSITION", 1}}}, {"indices", 0}},
                          {{"attributes", {{"POSITION", 0}}}, {"indices", 55}},
                          {{"attributes", {{"POSITION", 0}}}, {"mode", 9}},
                          {{"attributes", {{"POSITION", 0}, {"JOINTS_0", 0}}}},
                          {{"attributes", {{"POSITION", 0}}}, {"targets", {{{"POSITION", 44}}}}},
                          {{"attributes", {{"POSITION", 0}}}, {"material", 8}},
                          {{"attributes", Json::object()}},
                          {{"attributes", {{"POSITION", 0}}}, {"mode", 1}}};
  for (const Json& broken : kBroken) {
    SceneBuilder scene = one_triangle();
    const int unused = scene.add_mesh(broken);
    expect_scene(scene.glb(), {kAtRest}, "");
    const int node = scene.add("nodes", {{"mesh", unused}, {"skin", 5}});
    scene.add("nodes", {{"mesh", 33}, {"children", {node}}});
    scene.add("skins", {{"joints", {66}}});
    scene.root["scenes"].push_back({{"nodes", {2}}});
    expect_scene(scene.glb(), {kAtRest}, "");
    EXPECT_EQ(surfaces_of(*OpenScene(scene.glb()).source).size(), 1u);
  }
}

// A broken mesh that a descendant of a root draws is refused.
TEST(GltfPrimitives, UsedOnesAreChecked) {
  SceneBuilder scene = one_triangle();
  const int node =
      scene.add("nodes", {{"mesh", scene.add_mesh({{"attributes", {{"POSITION", 77}}}})}});
  const int parent = scene.add("nodes", {{"children", {node}}});
  scene.root["nodes"][0]["children"] = {parent};
  EXPECT_THAT(error_of_file(scene.glb()).message(),
              testing::HasSubstr("mesh 1: primitive 0: POSITION: accessor 77 does not exist"));
}

}  // namespace
}  // namespace voxdag::test
