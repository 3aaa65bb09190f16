// How nodes, instances and scenes place meshes in the world.
#include <gtest/gtest.h>

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using Point = std::array<double, 3>;

// Returns a scene with a degenerate triangle at the point (1 2 3), so that tests see to which
// position the nodes move it.
SceneBuilder corner_scene() {
  SceneBuilder scene;
  scene.add_mesh(
      {{"attributes", {{"POSITION", scene.add_positions({1, 2, 3, 1, 2, 3, 1, 2, 3})}}}});
  return scene;
}

std::vector<Point> corners_of(const SceneBuilder& scene) {
  std::vector<Point> corners;
  for (const Corners& t : triangles_of_file(scene.glb())) corners.push_back(t[0]);
  return corners;
}

// A node scales first, then rotates (here a quarter turn about z), then translates.
TEST(GltfNodes, ScaleThenRotateThenTranslate) {
  SceneBuilder scene = corner_scene();
  scene.add_root({{"mesh", 0},
                  {"translation", {100, 200, 300}},
                  {"rotation", {0, 0, 0.5, 0.5}},
                  {"scale", {2, -3, 5}}});
  // The quaternion is used as given, although its length is not 1. So the entries of its matrix are
  // 1 - 2 * 0.25 = 0.5 and 2 * 0.25 = 0.5.
  EXPECT_EQ(corners_of(scene),
            (std::vector<Point>{{100 + 0.5 * 2 + 0.5 * 6, 200 + 0.5 * 2 - 0.5 * 6, 315}}));
}

// A parent with an uneven scale above a rotated child shears the mesh. A negative scale mirrors the
// mesh.
TEST(GltfNodes, ShearedAndMirrored) {
  SceneBuilder scene = corner_scene();
  const int child = scene.add("nodes", {{"mesh", 0}, {"rotation", {0.5, 0.5, 0.5, 0.5}}});
  scene.add_root({{"scale", {-2, 1, 4}}, {"children", {child}}});
  // This rotation sends x to y, y to z, z to x.
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{-6, 1, 8}}));
}

// The matrix of a node is column-major, and can be any affine transform.
TEST(GltfNodes, Matrix) {
  SceneBuilder scene = corner_scene();
  scene.add_root({{"mesh", 0}, {"matrix", {1, 0, 0, 0, 2, 1, 0, 0, 0, 0, -1, 0, 7, 8, 9, 1}}});
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{12, 10, 6}}));
}

// A chain of 5000 nodes does not overflow the stack, and all of its transforms are applied.
TEST(GltfNodes, DeepChain) {
  constexpr int kDepth = 5000;
  SceneBuilder scene = corner_scene();
  for (int i = 0; i < kDepth; ++i) {
    Json node = {{"translation", {1, 0, 0}}};
    if (i + 1 < kDepth)
      node["children"] = {i + 1};
    else
      node["mesh"] = 0;
    scene.add("nodes", node);
  }
  scene.root["scenes"] = {{{"nodes", {0}}}};
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{kDepth + 1, 2, 3}}));
}

// The mesh of several nodes is read once for each node: parents before children, in the order of
// the file.
TEST(GltfNodes, SharedMesh) {
  SceneBuilder scene = corner_scene();
  scene.add("nodes", {{"mesh", 0}, {"translation", {10, 0, 0}}});
  scene.add("nodes", {{"mesh", 0}, {"translation", {20, 0, 0}}});
  scene.add_root({{"mesh", 0}, {"children", {1, 0}}});
  scene.add_root({{"mesh", 0}, {"translation", {30, 0, 0}}});
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{1, 2, 3}, {21, 2, 3}, {11, 2, 3}, {31, 2, 3}}));
}

// An instance's translation * rotation * scale is applied to vertices before the node's transform.
// The number of declared triangles includes the triangles of all instances.
TEST(GltfNodes, GpuInstances) {
  SceneBuilder scene = corner_scene();
  std::vector<float> translations, scales;
  std::vector<int16_t> rotations;
  constexpr int kInstances = 1000;
  for (int i = 0; i < kInstances; ++i) {
    translations.insert(translations.end(), {static_cast<float>(i), 0, 0});
    scales.insert(scales.end(), {1, i % 2 ? -1.f : 1.f, 1});
    rotations.insert(rotations.end(), {0, 0, 0, 32767});
  }
  const Json attributes = {
      {"TRANSLATION", scene.add_accessor<float>("VEC3", kF32, translations)},
      {"ROTATION", scene.add_accessor<int16_t>("VEC4", kI16, rotations, {{"normalized", true}})},
      {"SCALE", scene.add_accessor<float>("VEC3", kF32, scales)},
      {"_COLOR", 12345}};
  scene.add_root({{"mesh", 0},
                  {"scale", {10, 10, 10}},
                  {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
  scene.root["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  EXPECT_EQ(OpenScene(scene.glb()).source->declared_triangles(), uint64_t{kInstances});
  const std::vector<Point> corners = corners_of(scene);
  ASSERT_EQ(corners.size(), size_t{kInstances});
  for (int i = 0; i < kInstances; ++i)
    ASSERT_EQ(corners[static_cast<size_t>(i)], (Point{10.0 * (i + 1), i % 2 ? -20.0 : 20.0, 30}));
}

// The default scene is read. Without it the first scene is read, and without scenes all root nodes.
TEST(GltfNodes, WhichSceneIsDrawn) {
  SceneBuilder scene = corner_scene();
  for (int x : {10, 20, 30}) scene.add("nodes", {{"mesh", 0}, {"translation", {x, 0, 0}}});
  scene.root["nodes"][2]["children"] = {1};
  scene.root["scenes"] = {{{"nodes", {0}}}, {{"nodes", {2}}}};
  scene.root["scene"] = 1;
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{31, 2, 3}, {51, 2, 3}}));
  scene.root.erase("scene");
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{11, 2, 3}}));
  scene.root.erase("scenes");
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{11, 2, 3}, {31, 2, 3}, {51, 2, 3}}));
}

std::vector<Warning> warnings_of(const SceneBuilder& scene) {
  return OpenScene(scene.glb()).source->warnings();
}

// A scene lists root nodes. A listed node with a parent keeps its parent's transform. A node that
// is listed twice, or together with an ancestor, is drawn once. Warnings report these cases.
TEST(GltfNodes, ListedNodesWithParents) {
  SceneBuilder scene = corner_scene();
  scene.add("nodes", Json::object());
  scene.add("nodes", {{"children", {2}}, {"translation", {10, 0, 0}}});
  scene.add("nodes", {{"children", {3, 4}}, {"translation", {0, 20, 0}}, {"mesh", 0}});
  scene.add("nodes", {{"mesh", 0}, {"translation", {0, 0, 30}}});
  scene.add("nodes", {{"mesh", 0}, {"translation", {0, 0, 40}}});
  const Point all[] = {{11, 22, 3}, {11, 22, 33}, {11, 22, 43}};
  const auto expect = [&](const std::vector<int>& listed, const std::vector<Point>& points,
                          const std::vector<std::string>& codes) {
    scene.root["scenes"] = {{{"nodes", listed}}};
    EXPECT_EQ(corners_of(scene), points);
    std::vector<std::string> found;
    for (const Warning& warning : warnings_of(scene)) found.push_back(warning.code);
    EXPECT_EQ(found, codes);
  };
  const std::vector<Point> whole(std::begin(all), std::end(all));
  expect({1}, whole, {});
  expect({2}, whole, {"root-with-parent"});
  expect({4}, {all[2]}, {"root-with-parent"});
  expect({4, 3}, {all[2], all[1]}, {"root-with-parent"});
  expect({1, 2}, whole, {"root-with-parent"});
  expect({2, 1}, whole, {"root-with-parent"});
  expect({4, 1}, whole, {"root-with-parent"});
  expect({3, 2}, whole, {"root-with-parent", "root-with-parent"});
  expect({1, 1}, whole, {"repeated-node"});
  expect({3, 3, 1, 2, 1}, whole, {"repeated-node", "root-with-parent"});
  scene.root["nodes"][2]["children"] = {3, 4, 3};
  expect({1}, whole, {"repeated-node"});
}

// The warning about a listed node with a parent names the scene and the node.
TEST(GltfNodes, ListedNodesWithParentsAreNamed) {
  SceneBuilder scene = corner_scene();
  scene.add("nodes", Json::object());
  scene.add("nodes", {{"children", {2}}});
  scene.add("nodes", {{"mesh", 0}, {"name", "body"}});
  scene.root["scenes"] = {{{"nodes", {2}}}};
  EXPECT_EQ(texts_of(warnings_of(scene)),
            (std::vector<std::string>{
                "folder/scene: scene 0: node 2 \"body\": is listed although it has a parent; it "
                "keeps its parent's transform"}));
}

// Many listed nodes have the same long chain of ancestors. The time is linear in the number of
// nodes, because the chain is not walked again for each listed node.
TEST(GltfNodes, ManyListedNodesBelowAChain) {
  constexpr int kCount = 20000;
  SceneBuilder scene = corner_scene();
  scene.add("nodes", Json::object());
  for (int i = 0; i < kCount; ++i)
    scene.add("nodes", {{"children", {i + 2}}, {"translation", {1, 0, 0}}});
  const int deepest = scene.add("nodes", Json::object());
  std::vector<int> listed;
  for (int i = 0; i < kCount; ++i) listed.push_back(scene.add("nodes", {{"mesh", 0}}));
  scene.root["nodes"][static_cast<size_t>(deepest)]["children"] = listed;
  scene.root["scenes"] = {{{"nodes", listed}}};
  const std::vector<Point> corners = corners_of(scene);
  ASSERT_EQ(corners.size(), size_t{kCount});
  EXPECT_EQ(corners.front(), (Point{kCount + 1, 2, 3}));
  EXPECT_EQ(corners.back(), corners.front());
}

// KHR_node_visibility hides a node with its descendants, whether it is required or not.
TEST(GltfNodes, HiddenNodes) {
  const Json hidden = {{"KHR_node_visibility", {{"visible", false}}}};
  SceneBuilder scene = corner_scene();
  scene.add_root({{"mesh", 0}});
  scene.add_root({{"mesh", 0}, {"translation", {10, 0, 0}}, {"extensions", hidden}});
  const int child = scene.add("nodes", {{"mesh", 0}, {"translation", {20, 0, 0}}});
  const int parent = scene.add("nodes", {{"children", {child}}});
  scene.add_root({{"children", {parent}}, {"mesh", 0}, {"translation", {0, 30, 0}}});
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    scene.root[list] = {"KHR_node_visibility"};
    EXPECT_EQ(corners_of(scene), (std::vector<Point>{{1, 2, 3}, {1, 32, 3}, {21, 32, 3}}));
    EXPECT_TRUE(warnings_of(scene).empty());
  }
  Json& nodes = scene.root["nodes"];
  nodes[static_cast<size_t>(parent)]["extensions"] = hidden;
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{1, 2, 3}, {1, 32, 3}}));
  nodes[static_cast<size_t>(parent)]["extensions"]["KHR_node_visibility"]["visible"] = true;
  EXPECT_EQ(corners_of(scene).size(), 3u);
  nodes[static_cast<size_t>(parent)]["extensions"]["KHR_node_visibility"] = Json::object();
  EXPECT_EQ(corners_of(scene).size(), 3u);
  // A hidden node that is not listed hides its listed child.
  nodes[static_cast<size_t>(parent)]["extensions"] = hidden;
  scene.root["scenes"][0]["nodes"] = {0, child};
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{1, 2, 3}}));
  nodes[static_cast<size_t>(parent)]["extensions"]["KHR_node_visibility"]["visible"] = "no";
  EXPECT_THROW(corners_of(scene), Error);
}

// Meshes of hidden nodes can be broken, because they are not read.
TEST(GltfNodes, HiddenNodesAreNotChecked) {
  SceneBuilder scene = corner_scene();
  scene.add_root({{"mesh", 0}});
  scene.add_root({{"mesh", 77}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  EXPECT_EQ(corners_of(scene), (std::vector<Point>{{1, 2, 3}}));
}

// If a scene draws no mesh, a warning gives the reason.
TEST(GltfNodes, ScenesThatDrawNoMesh) {
  SceneBuilder scene = corner_scene();
  for (int i = 0; i < 2; ++i)
    scene.add_root({{"mesh", 0}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  EXPECT_EQ(texts_of(warnings_of(scene)),
            (std::vector<std::string>{"folder/scene: all its nodes with meshes are hidden "
                                      "(KHR_node_visibility) (2 times)"}));
  scene.root["scenes"] = {{{"name", "empty"}}, {{"nodes", {0}}}};
  EXPECT_EQ(warnings_of(scene).at(0).code, "scene-without-meshes");
}

// A rotation whose length is far from 1 is used unchanged, with a warning. A thousand such
// rotations do not cause a thousand warnings.
TEST(GltfNodes, RotationsThatAreNone) {
  SceneBuilder scene = corner_scene();
  for (int i = 0; i < 1000; ++i) scene.add_root({{"mesh", 0}, {"rotation", {0, 0, 0, 2}}});
  OpenScene open(scene.glb());
  EXPECT_EQ(open.triangles()[0][0], (Point{1, 2, 3}));
  const auto warnings = open.source->warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].place.ends_with(": node 0")) << warnings[0].place;
  EXPECT_NE(warnings[0].message.find("is not a unit quaternion"), std::string::npos);
  EXPECT_EQ(warnings[0].count, 1000u);
}

// A file in which nothing is drawn is a scene without triangles, not an error.
TEST(GltfNodes, NothingToDraw) {
  SceneBuilder scene;
  EXPECT_TRUE(corners_of(scene).empty());
  scene.add_root({{"camera", 0}, {"name", "eye"}});
  EXPECT_TRUE(corners_of(scene).empty());
}

// Several files make one scene, in the given order. Reading the scene again gives the same order.
TEST(GltfNodes, SeveralFiles) {
  SceneBuilder first = corner_scene(), second = corner_scene();
  first.add_root({{"mesh", 0}});
  second.add_root({{"mesh", 0}, {"translation", {5, 0, 0}}});
  MemoryFiles files;
  files.contents = {{"a", first.glb()}, {"b", second.glb()}};
  MemoryBudget budget(uint64_t{64} << 20);
  CancelToken cancel;
  const auto source = open_scene(files, {"b", "a", "b"}, {}, budget, cancel);
  EXPECT_EQ(source->declared_triangles(), 3u);
  const auto triangles = triangles_of(*source);
  ASSERT_EQ(triangles.size(), 3u);
  EXPECT_EQ(triangles[0][0], (Point{6, 2, 3}));
  EXPECT_EQ(triangles[1][0], (Point{1, 2, 3}));
  EXPECT_EQ(triangles[2][0], (Point{6, 2, 3}));
  EXPECT_EQ(triangles_of(*source), triangles);
}

}  // namespace
}  // namespace voxdag::test
