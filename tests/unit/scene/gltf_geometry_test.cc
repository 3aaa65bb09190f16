// Tests how the vertices and indices of a primitive become triangles, with small generated files.
#include <gtest/gtest.h>

#include <limits>

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

const std::vector<float> kSquare = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
const Corners kLower = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
const Corners kUpper = {{{1, 0, 0}, {1, 1, 0}, {0, 1, 0}}};

SceneBuilder scene_of(SceneBuilder scene, Json primitive) {
  scene.add_root({{"mesh", scene.add_mesh(std::move(primitive))}});
  return scene;
}

template <class T>
std::vector<Corners> indexed(int component_type) {
  SceneBuilder scene;
  const int positions = scene.add_positions(kSquare);
  const int indices = scene.add_accessor<T>("SCALAR", component_type, {0, 1, 2, 1, 3, 2});
  return triangles_of_file(
      scene_of(scene, {{"attributes", {{"POSITION", positions}}}, {"indices", indices}}).glb());
}

// Indices of three widths, and vertices without indices, give the same triangles.
TEST(GltfGeometry, IndicesOfEveryWidth) {
  const std::vector<Corners> expected = {kLower, kUpper};
  EXPECT_EQ(indexed<uint8_t>(kU8), expected);
  EXPECT_EQ(indexed<uint16_t>(kU16), expected);
  EXPECT_EQ(indexed<uint32_t>(kU32), expected);

  SceneBuilder scene;
  const int positions = scene.add_positions({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
  EXPECT_EQ(triangles_of_file(scene_of(scene, {{"attributes", {{"POSITION", positions}}}}).glb()),
            expected);
}

// A strip of four corners and a fan of four corners are two triangles each, indexed or not.
TEST(GltfGeometry, StripsAndFans) {
  SceneBuilder scene;
  const int positions = scene.add_positions(kSquare);
  const int round = scene.add_accessor<uint8_t>("SCALAR", kU8, {0, 1, 3, 2});
  const auto draw = [&](Json more) {
    Json primitive = {{"attributes", {{"POSITION", positions}}}};
    primitive.update(more);
    return triangles_of_file(scene_of(scene, primitive).glb());
  };
  const Corners second_of_strip = {{{1, 0, 0}, {0, 1, 0}, {1, 1, 0}}};
  EXPECT_EQ(draw({{"mode", 5}}), (std::vector<Corners>{kLower, second_of_strip}));
  const Corners first_of_fan = {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}};
  const Corners second_of_fan = {{{0, 0, 0}, {1, 1, 0}, {0, 1, 0}}};
  EXPECT_EQ(draw({{"mode", 6}, {"indices", round}}),
            (std::vector<Corners>{first_of_fan, second_of_fan}));
}

// The reader reads triangles in windows of 4096. A longer strip or fan continues in the next window
// without a gap.
TEST(GltfGeometry, LongStripAndFanCrossWindows) {
  constexpr size_t kVertices = 10000;
  std::vector<float> line;
  for (size_t i = 0; i < kVertices; ++i)
    line.insert(line.end(), {static_cast<float>(i), static_cast<float>(i % 2), 0});
  for (int mode : {5, 6}) {
    SceneBuilder scene;
    const int positions = scene.add_positions(line);
    const auto triangles = triangles_of_file(
        scene_of(scene, {{"attributes", {{"POSITION", positions}}}, {"mode", mode}}).glb());
    ASSERT_EQ(triangles.size(), kVertices - 2);
    for (size_t i = 0; i < triangles.size(); ++i) {
      ASSERT_EQ(triangles[i][0][0], mode == 6 ? 0.0 : static_cast<double>(i));
      ASSERT_EQ(triangles[i][2][0], static_cast<double>(i + 2));
    }
  }
}

// Vertices are 20 bytes apart and begin at an offset. The bytes between them are unused.
TEST(GltfGeometry, InterleavedVertices) {
  SceneBuilder scene;
  const float x = 1e30f;
  const int view =
      scene.add_view<float>({x, 0, 0, 0, x, x, 1, 0, 0, x, x, 0, 1, 0}, {{"byteStride", 20}});
  const int positions = scene.add("accessors", {{"bufferView", view},
                                                {"byteOffset", 4},
                                                {"componentType", kF32},
                                                {"count", 3},
                                                {"type", "VEC3"}});
  EXPECT_EQ(triangles_of_file(scene_of(scene, {{"attributes", {{"POSITION", positions}}}}).glb()),
            (std::vector<Corners>{kLower}));
}

// A byteStride that glTF does not allow is used, with a warning.
TEST(GltfGeometry, UnusualStrides) {
  const auto expected = triangles_of_file(one_triangle().glb());
  for (const size_t stride : {2, 3, 4, 6, 300}) {
    SceneBuilder scene = one_triangle();
    std::vector<uint8_t> bytes(2 * stride + 2);
    for (uint8_t i = 0; i < 3; ++i) bytes[i * stride] = i;
    scene.root["accessors"][1]["bufferView"] = scene.add_view(bytes, {{"byteStride", stride}});
    OpenScene open(scene.glb());
    EXPECT_EQ(open.triangles(), expected);
    EXPECT_EQ(texts_of(open.source->warnings()),
              (std::vector<std::string>{"folder/scene: bufferView 2: its byteStride of " +
                                        std::to_string(stride) +
                                        " is used, expected none because it is not for vertices"}));
  }
  for (const size_t stride : {13, 14, 254, 256, 70000}) {
    SceneBuilder scene = one_triangle();
    std::vector<char> bytes(2 * stride + 12);
    for (size_t i = 0; i < 3; ++i) std::memcpy(&bytes[i * stride], &scene.bin[12 * i], 12);
    scene.root["accessors"][0]["bufferView"] = scene.add_view(bytes, {{"byteStride", stride}});
    OpenScene open(scene.glb());
    EXPECT_EQ(open.triangles(), expected);
    EXPECT_EQ(texts_of(open.source->warnings()),
              (std::vector<std::string>{"folder/scene: bufferView 2: its byteStride of " +
                                        std::to_string(stride) +
                                        " is used, expected a multiple of 4 up to 252"}));
  }
}

// For the indices and values of sparse accessors, glTF allows no byteStride. If the file has one,
// it is used, with a warning.
TEST(GltfGeometry, SparseStrides) {
  SceneBuilder scene = one_triangle();
  scene.root["accessors"][0]["sparse"] = {
      {"count", 2},
      {"indices",
       {{"bufferView", scene.add_view<uint8_t>({0, 99, 2}, {{"byteStride", 2}})},
        {"componentType", kU8}}},
      {"values",
       {{"bufferView", scene.add_view<float>({5, 6, 7, 0, 8, 9, 10, 0}, {{"byteStride", 16}})}}}};
  OpenScene open(scene.glb());
  EXPECT_EQ(open.triangles(), (std::vector<Corners>{{{{5, 6, 7}, {1, 0, 0}, {8, 9, 10}}}}));
  EXPECT_EQ(open.source->warnings().size(), 2u);
}

// Integer positions are read, with a warning if the file does not declare KHR_mesh_quantization.
TEST(GltfGeometry, UndeclaredQuantization) {
  for (const int type : {kI16, kU16}) {
    SceneBuilder scene = one_triangle();
    const int view =
        scene.add_view<int16_t>({0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0}, {{"byteStride", 8}});
    scene.root["accessors"][0] = {
        {"bufferView", view}, {"componentType", type}, {"count", 3}, {"type", "VEC3"}};
    OpenScene open(scene.glb());
    EXPECT_EQ(open.triangles(), (std::vector<Corners>{{{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}}}));
    ASSERT_EQ(open.source->warnings().size(), 1u);
    EXPECT_EQ(open.source->warnings()[0].code, "undeclared-quantization");
    EXPECT_EQ(open.source->warnings()[0].place,
              "folder/scene: mesh 0: primitive 0: POSITION: accessor 0");
    scene.root["extensionsUsed"] = {"KHR_mesh_quantization"};
    EXPECT_TRUE(OpenScene(scene.glb()).source->warnings().empty());
  }
}

// Sparse elements replace elements of the base view, or zeros without a base view. This holds for
// vertices and for indices.
TEST(GltfGeometry, SparseAccessors) {
  const auto sparse = [](SceneBuilder& scene, std::vector<uint16_t> at, auto values) {
    return Json{{"count", at.size()},
                {"indices", {{"bufferView", scene.add_view(at)}, {"componentType", kU16}}},
                {"values", {{"bufferView", scene.add_view(values)}}}};
  };
  SceneBuilder scene;
  const int base =
      scene.add_accessor<float>("VEC3", kF32, {0, 0, 0, 9, 9, 9, 0, 1, 0},
                                {{"sparse", sparse(scene, {1}, std::vector<float>{1, 0, 0})}});
  const int zeros = scene.add(
      "accessors", {{"componentType", kF32},
                    {"count", 3},
                    {"type", "VEC3"},
                    {"sparse", sparse(scene, {1, 2}, std::vector<float>{1, 0, 0, 0, 1, 0})}});
  const int indices = scene.add_accessor<uint16_t>(
      "SCALAR", kU16, {0, 7, 2}, {{"sparse", sparse(scene, {1}, std::vector<uint16_t>{1})}});
  for (int positions : {base, zeros})
    EXPECT_EQ(triangles_of_file(
                  scene_of(scene, {{"attributes", {{"POSITION", positions}}}, {"indices", indices}})
                      .glb()),
              (std::vector<Corners>{kLower}));
}

// Thousands of sparse vertices, spread over many blocks, get the right positions.
TEST(GltfGeometry, ManySparseVertices) {
  constexpr uint32_t kVertices = 30000;
  SceneBuilder scene;
  std::vector<uint32_t> at;
  std::vector<float> values;
  for (uint32_t i = 1; i < kVertices; i += 1 + i % 3) {
    at.push_back(i);
    values.insert(values.end(), {static_cast<float>(i), 1, 0});
  }
  const Json sparse = {{"count", at.size()},
                       {"indices", {{"bufferView", scene.add_view(at)}, {"componentType", kU32}}},
                       {"values", {{"bufferView", scene.add_view(values)}}}};
  const int positions = scene.add(
      "accessors",
      {{"componentType", kF32}, {"count", kVertices}, {"type", "VEC3"}, {"sparse", sparse}});
  const auto triangles =
      triangles_of_file(scene_of(scene, {{"attributes", {{"POSITION", positions}}}}).glb());
  ASSERT_EQ(triangles.size(), kVertices / 3);
  for (uint32_t i = 0; i < kVertices; ++i) {
    const bool replaced = std::ranges::binary_search(at, i);
    ASSERT_EQ(triangles[i / 3][i % 3][0], replaced ? i : 0.0) << i;
    ASSERT_EQ(triangles[i / 3][i % 3][1], replaced ? 1.0 : 0.0) << i;
  }
}

// A normalized integer is divided, in doubles, by the largest value of its type. The most negative
// value becomes -1, as does its neighbor. Other integers are used unchanged.
TEST(GltfGeometry, QuantizedPositions) {
  const auto first_corner = [](auto values, int type, bool normalized) {
    SceneBuilder scene;
    scene.root["extensionsUsed"] = scene.root["extensionsRequired"] = {"KHR_mesh_quantization"};
    const int positions = scene.add_accessor("VEC3", type, values, {{"normalized", normalized}});
    return triangles_of_file(scene_of(scene, {{"attributes", {{"POSITION", positions}}}}).glb())
        .at(0)
        .at(0);
  };
  using Point = std::array<double, 3>;
  const std::vector<int8_t> i8 = {-128, 127, 3, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(first_corner(i8, kI8, true), (Point{-1, 1, 3 / 127.0}));
  EXPECT_EQ(first_corner(i8, kI8, false), (Point{-128, 127, 3}));
  const std::vector<uint8_t> u8 = {0, 255, 7, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(first_corner(u8, kU8, true), (Point{0, 1, 7 / 255.0}));
  const std::vector<int16_t> i16 = {-32768, 32767, -5, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(first_corner(i16, kI16, true), (Point{-1, 1, -5 / 32767.0}));
  const std::vector<uint16_t> u16 = {65535, 1, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(first_corner(u16, kU16, true), (Point{1, 1 / 65535.0, 0}));
  EXPECT_EQ(first_corner(u16, kU16, false), (Point{65535, 1, 0}));
}

// Points and lines give no triangles, and a warning reports them. Their vertices can have any
// values, because they are not read.
TEST(GltfGeometry, PointsAndLinesAreNamedInAWarning) {
  SceneBuilder scene = one_triangle();
  const int positions = scene.add_positions({50, 50, 50, 60, 60, 60, 70, 70, 70});
  for (int mode : {0, 1, 2, 3})
    scene.root["meshes"][0]["primitives"].push_back(
        {{"attributes", {{"POSITION", positions}}}, {"mode", mode}});
  OpenScene open(scene.glb());
  EXPECT_EQ(open.source->declared_triangles(), 1u);
  EXPECT_EQ(open.triangles(), (std::vector<Corners>{kLower}));
  ASSERT_EQ(open.source->warnings().size(), 1u);
  EXPECT_EQ(open.source->warnings()[0].code, "points-or-lines");
  EXPECT_EQ(open.source->warnings()[0].count, 4u);
}

// The last one or two corners of a list, which are not enough for a triangle, are ignored with a
// warning.
TEST(GltfGeometry, LeftoverCornersAreNamedInAWarning) {
  SceneBuilder scene;
  const int positions = scene.add_positions(kSquare);
  OpenScene open(scene_of(scene, {{"attributes", {{"POSITION", positions}}}}).glb());
  EXPECT_EQ(open.triangles(), (std::vector<Corners>{kLower}));
  ASSERT_EQ(open.source->warnings().size(), 1u);
  EXPECT_NE(open.source->warnings()[0].text().find("accessor 0: its count is not a multiple"),
            std::string::npos);
}

// Returns the triangles of a scene with one primitive of type `mode` per row, and no restarts. Each
// row is a strip or a fan.
std::vector<Corners> separate_rows(const std::vector<std::vector<uint32_t>>& rows, int mode,
                                   const std::vector<float>& positions) {
  SceneBuilder scene;
  const int position = scene.add_positions(positions);
  Json primitives = Json::array();
  for (const auto& row : rows)
    primitives.push_back({{"attributes", {{"POSITION", position}}},
                          {"indices", scene.add_accessor("SCALAR", kU32, row)},
                          {"mode", mode}});
  scene.add_root({{"mesh", scene.add("meshes", {{"primitives", primitives}})}});
  return triangles_of_file(scene.glb());
}

// Returns a scene with one primitive that contains all rows. Each row ends with the largest number
// of T, at which KHR_mesh_primitive_restart ends a strip or fan.
template <class T>
SceneBuilder joined_rows(const std::vector<std::vector<uint32_t>>& rows, int mode,
                         const std::vector<float>& positions, int component_type) {
  std::vector<T> indices;
  for (const auto& row : rows) {
    for (const uint32_t index : row) indices.push_back(static_cast<T>(index));
    indices.push_back(std::numeric_limits<T>::max());
  }
  SceneBuilder scene;
  scene.root["extensionsUsed"] = {"KHR_mesh_primitive_restart"};
  const int position = scene.add_positions(positions);
  const int accessor = scene.add_accessor("SCALAR", component_type, indices);
  return scene_of(
      scene, {{"attributes", {{"POSITION", position}}}, {"indices", accessor}, {"mode", mode}});
}

// Sorts the corners of each triangle, so that comparisons ignore the winding. The reader gives all
// triangles of a strip the same winding only if the strip has restarts.
std::vector<Corners> without_winding(std::vector<Corners> triangles) {
  for (Corners& corners : triangles) std::ranges::sort(corners);
  return triangles;
}

std::vector<float> bumpy_line(size_t vertices) {
  std::vector<float> xyz;
  for (size_t i = 0; i < vertices; ++i)
    xyz.insert(xyz.end(), {static_cast<float>(i), static_cast<float>(i * i % 7), 0});
  return xyz;
}

// With KHR_mesh_primitive_restart, the largest index ends a row of a strip or fan. Empty rows, and
// rows that are too short for a triangle, are allowed.
TEST(GltfGeometry, RestartsOfEveryWidth) {
  const std::vector<std::vector<uint32_t>> rows = {
      {}, {0, 1, 2, 3, 4}, {5, 6}, {}, {9, 8, 7}, {3}, {10, 3, 5, 4, 4, 6, 200}};
  const auto positions = bumpy_line(201);
  for (const int mode : {5, 6}) {
    const auto expected = without_winding(separate_rows(rows, mode, positions));
    ASSERT_EQ(expected.size(), 9u);
    const auto read = [&](SceneBuilder scene) {
      std::vector<Corners> triangles = triangles_of_file(scene.glb());
      EXPECT_EQ(without_winding(triangles), expected);
      scene.root["extensionsRequired"] = scene.root["extensionsUsed"];
      EXPECT_EQ(triangles_of_file(scene.glb()), triangles);
    };
    read(joined_rows<uint8_t>(rows, mode, positions, kU8));
    read(joined_rows<uint16_t>(rows, mode, positions, kU16));
    read(joined_rows<uint32_t>(rows, mode, positions, kU32));
  }
}

TEST(GltfGeometry, RestartsKeepOneWinding) {
  const auto scene = joined_rows<uint8_t>({{0, 1, 2, 3}, {0, 1, 2, 3}}, 5, kSquare, kU8);
  const Corners second_of_strip = {{{0, 1, 0}, {1, 0, 0}, {1, 1, 0}}};
  OpenScene open(scene.glb());
  EXPECT_EQ(open.triangles(),
            (std::vector<Corners>{kLower, second_of_strip, kLower, second_of_strip}));
  for (const SurfaceTriangle& surface : surfaces_of(*open.source)) EXPECT_FALSE(surface.is_flipped);
}

// Rows can be longer than a window (the triangles that the reader reads in one step), and there can
// be thousands of rows. A cursor can begin at any triangle.
TEST(GltfGeometry, RestartsCanBeReadFromAnyTriangle) {
  std::vector<std::vector<uint32_t>> rows(3);
  for (uint32_t i = 0; i < 9000; ++i) rows[1].push_back(i);
  for (uint32_t i = 0; i < 5000; ++i) rows.push_back({i, i + 1, i + 2, i + 3});
  const auto positions = bumpy_line(9000);
  for (const int mode : {5, 6}) {
    const auto expected = without_winding(separate_rows(rows, mode, positions));
    OpenScene open(joined_rows<uint16_t>(rows, mode, positions, kU16).glb());
    ASSERT_EQ(open.source->declared_triangles(), 18998u);
    EXPECT_EQ(without_winding(open.triangles()), expected);
    for (const uint64_t first : {0, 1, 1023, 1024, 5000, 8997, 8998, 9001, 18000}) {
      std::vector<Corners> part;
      open.source->open(2)->read(first, 900, [&](std::span<const WorldTriangle> batch) {
        for (const WorldTriangle& t : batch) {
          part.emplace_back();
          for (size_t k = 0; k < 3; ++k) std::copy_n(t.v[k], 3, part.back()[k].begin());
        }
      });
      const auto from = expected.begin() + static_cast<ptrdiff_t>(first);
      EXPECT_EQ(without_winding(part), std::vector<Corners>(from, from + 900)) << first;
    }
  }
}

// Without the extension, and in triangle lists, the largest index is an index like all others.
TEST(GltfGeometry, OnlyTheExtensionRestarts) {
  SceneBuilder scene = joined_rows<uint8_t>({{0, 1, 2, 3}, {0, 1, 2}}, 5, kSquare, kU8);
  scene.root.erase("extensionsUsed");
  EXPECT_NE(error_of_file(scene.glb()).message().find("index 255 of accessor 1 does not exist"),
            std::string::npos);
  SceneBuilder list = joined_rows<uint8_t>({{0, 1, 2}}, 4, kSquare, kU8);
  EXPECT_EQ(triangles_of_file(list.glb()), (std::vector<Corners>{kLower}));
  SceneBuilder all = joined_rows<uint8_t>({{0, 1}}, 4, kSquare, kU8);
  EXPECT_NE(error_of_file(all.glb()).message().find("index 255"), std::string::npos);
}

// Restarts in a primitive of lines are ignored. A primitive in which every row is too short for a
// triangle has no triangles.
TEST(GltfGeometry, RestartsWithoutTriangles) {
  SceneBuilder scene = joined_rows<uint16_t>({{}, {}, {0, 1}}, 5, kSquare, kU16);
  Json lines = scene.root["meshes"][0]["primitives"][0];
  lines["mode"] = 3;
  scene.root["meshes"][0]["primitives"].push_back(lines);
  scene.root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 0}}}, {"mode", 5}});
  EXPECT_EQ(triangles_of_file(scene.glb()).size(), 2u);
}

// Morph targets move vertices by the mesh's weights, or by the node's weights if it has any.
TEST(GltfGeometry, MorphTargetsAtRest) {
  SceneBuilder scene;
  const int positions = scene.add_positions({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const int up = scene.add_positions({0, 0, 1, 0, 0, 2, 0, 0, 4});
  const int aside = scene.add_positions({8, 0, 0, 8, 0, 0, 8, 0, 0});
  const int mesh =
      scene.add("meshes", {{"primitives",
                            {{{"attributes", {{"POSITION", positions}}},
                              {"targets", {{{"POSITION", up}}, {{"POSITION", aside}}}}}}},
                           {"weights", {0.5, 0}}});
  scene.add_root({{"mesh", mesh}});
  scene.add_root({{"mesh", mesh}, {"weights", {1, 0.25}}});
  const Corners by_mesh = {{{0, 0, 0.5}, {1, 0, 1}, {0, 1, 2}}};
  const Corners by_node = {{{2, 0, 1}, {3, 0, 2}, {2, 1, 4}}};
  EXPECT_EQ(triangles_of_file(scene.glb()), (std::vector<Corners>{by_mesh, by_node}));
}

// The joints' global transforms and inverse bind matrices alone determine the position of a skinned
// vertex. The transform of the node that has the mesh has no effect.
TEST(GltfGeometry, SkinAtRest) {
  SceneBuilder scene;
  const int positions = scene.add_positions({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const int joints =
      scene.add_accessor<uint8_t>("VEC4", kU8, {0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 99, 0});
  const int weights =
      scene.add_accessor<float>("VEC4", kF32, {1, 0, 0, 0, 1, 0, 0, 0, 0.5, 0.5, 0, 0});
  std::vector<float> inverse_bind(32, 0);
  for (size_t m : {0, 16})
    for (size_t i : {0, 5, 10, 15}) inverse_bind[m + i] = 1;
  inverse_bind[16 + 12] = -2;
  const int bind = scene.add_accessor<float>("MAT4", kF32, inverse_bind);
  const int mesh = scene.add_mesh(
      {{"attributes", {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}}});
  const int child = scene.add("nodes", {{"translation", {0, 0, 3}}});
  const int parent = scene.add_root({{"translation", {10, 0, 0}}, {"children", {child}}});
  scene.add("skins", {{"joints", {parent, child}}, {"inverseBindMatrices", bind}});
  scene.add_root({{"mesh", mesh}, {"skin", 0}, {"translation", {1000, 0, 0}}});
  // Joint 0 moves vertices by (10 0 0). Joint 1 moves them by (8 0 3): its node by (10 0 3), its
  // inverse bind matrix by (-2 0 0).
  const Corners expected = {{{10, 0, 0}, {9, 0, 3}, {9, 1, 1.5}}};
  EXPECT_EQ(triangles_of_file(scene.glb()), (std::vector<Corners>{expected}));
}

// The time for a skeleton of 20 000 joints in one chain is proportional to the number of joints.
TEST(GltfGeometry, LongSkeleton) {
  constexpr int kJoints = 20000;
  SceneBuilder scene;
  const int positions = scene.add_positions(std::vector<float>(9, 0));
  const uint16_t last = kJoints - 1;
  const int joints =
      scene.add_accessor<uint16_t>("VEC4", kU16, {last, 0, 0, 0, last, 0, 0, 0, last, 0, 0, 0});
  const int weights = scene.add_accessor<float>("VEC4", kF32, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const int mesh = scene.add_mesh(
      {{"attributes", {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}}});
  Json all = Json::array();
  for (int i = 0; i < kJoints; ++i) {
    Json node = {{"translation", {1, 0, 0}}};
    if (i + 1 < kJoints) node["children"] = {i + 1};
    all.push_back(scene.add("nodes", node));
  }
  scene.add("skins", {{"joints", all}});
  const int body = scene.add("nodes", {{"mesh", mesh}, {"skin", 0}});
  scene.root["scenes"] = {{{"nodes", {0, body}}}};
  EXPECT_EQ(triangles_of_file(scene.glb()).at(0)[0], (std::array<double, 3>{kJoints, 0, 0}));
}

// A weighted joint that the skin does not have makes its vertex invalid.
TEST(GltfGeometry, JointOutOfRangeIsRefused) {
  SceneBuilder scene;
  const int positions = scene.add_positions({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const int joints = scene.add_accessor<uint8_t>("VEC4", kU8, {0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0});
  const int weights = scene.add_accessor<uint8_t>(
      "VEC4", kU8, {255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0}, {{"normalized", true}});
  const int mesh = scene.add_mesh(
      {{"attributes", {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}}});
  const int joint = scene.add_root(Json::object());
  scene.add("skins", {{"joints", {joint}}});
  scene.add_root({{"mesh", mesh}, {"skin", 0}, {"name", "body"}});
  const Error error = error_of_file(scene.glb());
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  EXPECT_NE(error.message().find("node 1 \"body\": mesh 0: primitive 0"), std::string::npos)
      << error.message();
}

}  // namespace
}  // namespace voxdag::test
