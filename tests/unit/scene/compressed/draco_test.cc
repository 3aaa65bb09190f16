// KHR_draco_mesh_compression: a scene with a compressed primitive gives the same triangles as a
// scene that stores the output of Draco's own decoder uncompressed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <thread>

#include "tests/unit/scene/compressed/draco_scenes.h"

#ifdef VOXDAG_HAS_DRACO
#include <draco/metadata/geometry_metadata.h>
#endif

namespace voxdag::test {
namespace {

#ifdef VOXDAG_HAS_DRACO

template <class T>
std::vector<T> values_of(const draco::Mesh& mesh, int unique_id) {
  const draco::PointAttribute& attribute =
      *mesh.GetAttributeByUniqueId(static_cast<uint32_t>(unique_id));
  const auto components = static_cast<size_t>(attribute.num_components());
  std::vector<T> all(mesh.num_points() * components);
  for (uint32_t p = 0; p < mesh.num_points(); ++p)
    attribute.GetMappedValue(draco::PointIndex(p), &all[p * components]);
  return all;
}

std::vector<uint32_t> faces_of(const draco::Mesh& mesh) {
  std::vector<uint32_t> all;
  for (uint32_t f = 0; f < mesh.num_faces(); ++f)
    for (int k = 0; k < 3; ++k) all.push_back(mesh.face(draco::FaceIndex(f))[k].value());
  return all;
}

// Returns a scene that stores the positions and faces of `mesh` uncompressed.
SceneBuilder plain_scene(const draco::Mesh& mesh) {
  SceneBuilder scene;
  const int positions = scene.add_positions(values_of<float>(mesh, 0));
  const int indices = scene.add_accessor("SCALAR", kU32, faces_of(mesh));
  scene.add_root({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}},
                                           {"indices", indices}})}});
  return scene;
}

TEST(GltfDraco, EqualsTheDecodedScene) {
  for (const bool with_normals : {false, true}) {
    for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
      for (const int bits : {0, 9, 14}) {
        SCOPED_TRACE(testing::Message() << with_normals << ' ' << method << ' ' << bits);
        const auto data = encode_draco(*bumpy_grid(40, with_normals), method, bits);
        const auto triangles = triangles_of_file(compressed_scene_of(data).glb());
        ASSERT_EQ(triangles.size(), 3200u);
        EXPECT_EQ(triangles, triangles_of_file(plain_scene(*decode_draco(data)).glb()));
      }
    }
  }
}

// Adds texture coordinates that the encoder can predict: linear functions of the positions.
void add_texture_coordinates(draco::Mesh& mesh) {
  draco::GeometryAttribute texture;
  texture.Init(draco::GeometryAttribute::TEX_COORD, nullptr, 2, draco::DT_FLOAT32, false, 8, 0);
  const int id = mesh.AddAttribute(texture, true, mesh.num_points());
  for (uint32_t p = 0; p < mesh.num_points(); ++p) {
    const draco::PointAttribute& positions = *mesh.attribute(0);
    float at[3];
    positions.GetMappedValue(draco::PointIndex(p), at);
    const float uv[2] = {at[0] / 60, at[1] / 50};
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(p), uv);
  }
}

// Tests every speed of the encoder. Together, the encoded meshes use edgebreaker connectivity with
// valences, all predictions, and raw and tagged symbols.
TEST(GltfDraco, AllEncodersAreRead) {
  for (const uint32_t n : {3u, 40u})
    for (const bool with_normals : {false, true})
      for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING})
        for (const int bits : {5, 12, 20})
          for (const int speed : {0, 1, 2, 3, 5, 7, 10}) {
            SCOPED_TRACE(testing::Message() << n << ' ' << with_normals << ' ' << method << ' '
                                            << bits << ' ' << speed);
            auto mesh = bumpy_grid(n, with_normals);
            add_texture_coordinates(*mesh);
            const auto data = encode_draco(*mesh, method, bits, speed);
            EXPECT_EQ(triangles_of_file(compressed_scene_of(data).glb()),
                      triangles_of_file(plain_scene(*decode_draco(data)).glb()));
          }
}

TEST(GltfDraco, MetadataArePassedOver) {
  auto mesh = bumpy_grid(5, false);
  auto metadata = std::make_unique<draco::GeometryMetadata>();
  metadata->AddEntryString("name", "a grid");
  metadata->AddEntryInt("number", 7);
  auto inner = std::make_unique<draco::Metadata>();
  inner->AddEntryString("deep", "down");
  auto innermost = std::make_unique<draco::Metadata>();
  innermost->AddEntryDouble("x", 1.5);
  inner->AddSubMetadata("deeper", std::move(innermost));
  metadata->AddSubMetadata("inner", std::move(inner));
  metadata->AddSubMetadata("empty", std::make_unique<draco::Metadata>());
  auto of_attribute = std::make_unique<draco::AttributeMetadata>();
  of_attribute->AddEntryString("name", "position");
  mesh->AddMetadata(std::move(metadata));
  mesh->AddAttributeMetadata(0, std::move(of_attribute));
  const auto data = encode_draco(*mesh, draco::MESH_EDGEBREAKER_ENCODING, 11);
  EXPECT_EQ(triangles_of_file(compressed_scene_of(data).glb()),
            triangles_of_file(plain_scene(*decode_draco(data)).glb()));
}

// Texture coordinates and colors are equal to the output of Draco's own decoder.
TEST(GltfDraco, SurfacesAreCompressed) {
  auto mesh = bumpy_grid(6, false);
  const uint32_t points = mesh->num_points();
  draco::GeometryAttribute texture, color;
  texture.Init(draco::GeometryAttribute::TEX_COORD, nullptr, 2, draco::DT_FLOAT32, false, 8, 0);
  color.Init(draco::GeometryAttribute::COLOR, nullptr, 4, draco::DT_UINT8, true, 4, 0);
  const int texture_id = mesh->AddAttribute(texture, true, points);
  const int color_id = mesh->AddAttribute(color, true, points);
  for (uint32_t p = 0; p < points; ++p) {
    const float uv[2] = {static_cast<float>(p % 7) / 6, static_cast<float>(p) / 40};
    const uint8_t rgba[4] = {static_cast<uint8_t>(p), static_cast<uint8_t>(255 - p), 7, 200};
    mesh->attribute(texture_id)->SetAttributeValue(draco::AttributeValueIndex(p), uv);
    mesh->attribute(color_id)->SetAttributeValue(draco::AttributeValueIndex(p), rgba);
  }
  const auto data = encode_draco(*mesh, draco::MESH_EDGEBREAKER_ENCODING, 12);
  const auto decoded = decode_draco(data);

  const auto add_material = [](SceneBuilder& scene, int uv, int rgba) {
    scene.root["images"] = {{{"uri", "data:image/png;base64,"}}};
    scene.root["textures"] = {{{"source", 0}}};
    scene.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    Json& primitive = scene.root["meshes"][0]["primitives"][0];
    primitive["material"] = 0;
    primitive["attributes"]["TEXCOORD_0"] = uv;
    primitive["attributes"]["COLOR_0"] = rgba;
    OpenScene open(scene.glb());
    EXPECT_TRUE(open.source->materials().warnings.list().empty());
    return surfaces_of(*open.source);
  };
  SceneBuilder plain = plain_scene(*decoded);
  const int uv = plain.add_accessor("VEC2", kF32, values_of<float>(*decoded, texture_id));
  const int rgba = plain.add_accessor("VEC4", kU8, values_of<uint8_t>(*decoded, color_id),
                                      {{"normalized", true}});
  const auto expected = add_material(plain, uv, rgba);
  SceneBuilder scene =
      compressed_scene(data, points, 3 * mesh->num_faces(),
                       {{"POSITION", 0}, {"TEXCOORD_0", texture_id}, {"COLOR_0", color_id}});
  const int own_uv =
      scene.add("accessors", {{"componentType", kF32}, {"count", points}, {"type", "VEC2"}});
  const int own_rgba = scene.add(
      "accessors",
      {{"componentType", kU8}, {"count", points}, {"type", "VEC4"}, {"normalized", true}});
  const auto found = add_material(scene, own_uv, own_rgba);
  ASSERT_EQ(found.size(), 72u);
  ASSERT_EQ(expected.size(), 72u);
  for (size_t i = 0; i < found.size(); ++i)
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(found[i].corners[k].texture, expected[i].corners[k].texture);
      EXPECT_EQ(found[i].corners[k].color, expected[i].corners[k].color);
    }
}

// Joints and weights come from generic attributes, and the skin moves the vertices.
TEST(GltfDraco, SkinsAreCompressed) {
  auto mesh = bumpy_grid(6, false);
  const uint32_t points = mesh->num_points();
  draco::GeometryAttribute joints, weights;
  joints.Init(draco::GeometryAttribute::GENERIC, nullptr, 4, draco::DT_UINT8, false, 4, 0);
  weights.Init(draco::GeometryAttribute::GENERIC, nullptr, 4, draco::DT_FLOAT32, false, 16, 0);
  const int joints_id = mesh->AddAttribute(joints, true, points);
  const int weights_id = mesh->AddAttribute(weights, true, points);
  for (uint32_t p = 0; p < points; ++p) {
    const uint8_t j[4] = {static_cast<uint8_t>(p % 2), 1, 0, 0};
    const float w[4] = {static_cast<float>(p % 5) / 4, 1 - static_cast<float>(p % 5) / 4, 0, 0};
    mesh->attribute(joints_id)->SetAttributeValue(draco::AttributeValueIndex(p), j);
    mesh->attribute(weights_id)->SetAttributeValue(draco::AttributeValueIndex(p), w);
  }
  draco::ExpertEncoder encoder(*mesh);
  encoder.SetAttributeQuantization(0, 12);
  encoder.SetAttributeQuantization(weights_id, 8);
  draco::EncoderBuffer buffer;
  ASSERT_TRUE(encoder.EncodeToBuffer(&buffer).ok());
  const std::vector<char> data(buffer.data(), buffer.data() + buffer.size());
  const auto decoded = decode_draco(data);

  const auto add_skin = [](SceneBuilder& scene, int j, int w) {
    Json& attributes = scene.root["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = j;
    attributes["WEIGHTS_0"] = w;
    scene.root["nodes"][0]["skin"] = 0;
    const int a = scene.add_root({{"translation", {10, 0, 0}}});
    const int b = scene.add_root({{"scale", {1, 2, 3}}});
    scene.add("skins", {{"joints", {a, b}}});
  };
  SceneBuilder compressed =
      compressed_scene(data, points, 3 * decoded->num_faces(),
                       {{"POSITION", 0}, {"JOINTS_0", joints_id}, {"WEIGHTS_0", weights_id}});
  const auto accessor = [&](int type) {
    return compressed.add("accessors",
                          {{"componentType", type}, {"count", points}, {"type", "VEC4"}});
  };
  const int j = accessor(kU8), w = accessor(kF32);
  add_skin(compressed, j, w);
  SceneBuilder plain = plain_scene(*decoded);
  const int pj = plain.add_accessor("VEC4", kU8, values_of<uint8_t>(*decoded, joints_id));
  const int pw = plain.add_accessor("VEC4", kF32, values_of<float>(*decoded, weights_id));
  add_skin(plain, pj, pw);
  EXPECT_EQ(triangles_of_file(compressed.glb()), triangles_of_file(plain.glb()));
}

// The index count of a strip includes the degenerate triangles that join two strips. Draco data do
// not contain these triangles, so the reader repeats the last face once for each of them.
TEST(GltfDraco, StripsHaveTheirFacesAndNoOthers) {
  const auto data = encode_draco(*bumpy_grid(4, false), draco::MESH_EDGEBREAKER_ENCODING, 10);
  SceneBuilder scene = compressed_scene(data, 25, 4 * 10 + 3 * 2);
  scene.root["meshes"][0]["primitives"][0]["mode"] = 5;
  auto strip = triangles_of_file(scene.glb());
  EXPECT_EQ(strip.size(), 44u);
  auto faces = triangles_of_file(plain_scene(*decode_draco(data)).glb());
  for (auto* all : {&strip, &faces}) {
    std::ranges::sort(*all);
    all->erase(std::unique(all->begin(), all->end()), all->end());
  }
  EXPECT_EQ(strip, faces);
}

std::string message_of(const SceneBuilder& scene, ErrorCode code = ErrorCode::kInvalidInput) {
  const Error error = error_of_file(scene.glb());
  EXPECT_EQ(error.code(), code) << error.message();
  return error.message();
}

// If the counts in the data differ from the accessors' counts, the counts in the data are used.
// Tests more and fewer vertices and faces, both methods of Draco, and data with normals per face.
TEST(GltfDraco, CountsOfTheDataAreRead) {
  for (const bool with_normals : {false, true})
    for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
      const auto data = encode_draco(*bumpy_grid(6, with_normals), method, 10);
      const auto mesh = decode_draco(data);
      const auto expected = triangles_of_file(plain_scene(*mesh).glb());
      const uint64_t points = mesh->num_points();
      const auto expect = [&](uint64_t vertices, uint64_t indices, size_t warnings, int mode = 4) {
        SCOPED_TRACE(testing::Message() << with_normals << ' ' << method << ' ' << vertices << ' '
                                        << indices << ' ' << mode);
        SceneBuilder scene = compressed_scene(data, vertices, indices);
        scene.root["meshes"][0]["primitives"][0]["mode"] = mode;
        OpenScene open(scene.glb());
        EXPECT_EQ(open.triangles(), expected);
        ASSERT_EQ(open.source->warnings().size(), warnings);
        if (warnings > 0) {
          EXPECT_EQ(open.source->warnings()[0].code, "draco-counts");
        }
      };
      expect(points, 216, 0);
      for (const uint64_t vertices :
           {uint64_t{1}, points - 3, points + 3, 400 * points, uint64_t{1} << 31})
        expect(vertices, 216, 1);
      for (const uint64_t indices :
           {uint64_t{0}, uint64_t{3}, uint64_t{213}, uint64_t{219}, uint64_t{3} << 30})
        expect(points, indices, 1);
      expect(7, 3, 1);
      expect(points, 3000, 1, 5);
      expect(points, 20, 1, 5);
    }
}

// If faces do not share normals, only decoding shows the number of vertices. Large meshes are
// decoded late. Then more vertices than declared are an error, and fewer vertices are accepted.
TEST(GltfDraco, CountsThatTheHeaderDoesNotShow) {
  const auto data = encode_draco(*bumpy_grid(60, true), draco::MESH_EDGEBREAKER_ENCODING, 10);
  const auto mesh = decode_draco(data);
  const uint64_t points = mesh->num_points();
  EXPECT_THAT(message_of(compressed_scene(data, points - 1, 3 * mesh->num_faces())),
              testing::HasSubstr("expected at most " + std::to_string(points - 1)));
  EXPECT_EQ(triangles_of_file(compressed_scene(data, points + 1, 3 * mesh->num_faces()).glb()),
            triangles_of_file(plain_scene(*mesh).glb()));
}

// All attributes have the data's vertex count, even if their accessors declare other counts.
TEST(GltfDraco, SurfacesHaveTheCountsOfTheData) {
  auto mesh = bumpy_grid(4, false);
  draco::GeometryAttribute color;
  color.Init(draco::GeometryAttribute::COLOR, nullptr, 4, draco::DT_UINT8, true, 4, 0);
  const int id = mesh->AddAttribute(color, true, mesh->num_points());
  for (uint32_t p = 0; p < mesh->num_points(); ++p) {
    const uint8_t rgba[4] = {255, 0, 255, 255};
    mesh->attribute(id)->SetAttributeValue(draco::AttributeValueIndex(p), rgba);
  }
  const auto data = encode_draco(*mesh, draco::MESH_SEQUENTIAL_ENCODING, 10);
  for (const uint64_t vertices : {20, 25, 30}) {
    SceneBuilder scene = compressed_scene(data, vertices, 96, {{"POSITION", 0}, {"COLOR_0", id}});
    scene.root["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] =
        scene.add("accessors",
                  {{"componentType", kU8}, {"count", 22}, {"type", "VEC4"}, {"normalized", true}});
    OpenScene open(scene.glb());
    const auto surfaces = surfaces_of(*open.source);
    ASSERT_EQ(surfaces.size(), 32u);
    for (const SurfaceTriangle& surface : surfaces)
      for (const SurfaceCorner& corner : surface.corners) EXPECT_EQ(corner.color[1], 0u);
  }
}

// Uncompressed morph targets must have as many elements as the Draco data have vertices.
TEST(GltfDraco, TargetsMustHaveTheCountOfTheData) {
  const auto data = encode_draco(*bumpy_grid(4, false), draco::MESH_EDGEBREAKER_ENCODING, 10);
  for (const size_t targets : {20u, 25u}) {
    SceneBuilder scene = compressed_scene(data, 20, 96);
    const int target = scene.add_positions(std::vector<float>(3 * targets));
    scene.root["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", target}}};
    const std::string message = error_of_file(scene.glb()).message();
    if (targets == 25)
      EXPECT_EQ(message, "");
    else
      EXPECT_THAT(message, testing::HasSubstr("has 20 elements, expected 25"));
  }
}

// Each primitive is decoded once for any number of readers. A reader can begin at any triangle.
TEST(GltfDraco, ReadersShareWhatIsDecoded) {
  const auto data = encode_draco(*bumpy_grid(60, false), draco::MESH_EDGEBREAKER_ENCODING, 12);
  OpenScene scene(compressed_scene_of(data).glb());
  const auto expected = triangles_of_file(plain_scene(*decode_draco(data)).glb());
  std::vector<std::thread> threads;
  std::atomic<int> equal = 0;
  for (uint64_t first : {7000, 3, 6000, 100}) {
    threads.emplace_back([&, first] {
      std::vector<Corners> part;
      scene.source->open(4)->read(first, 150, [&](std::span<const WorldTriangle> batch) {
        for (const WorldTriangle& t : batch) {
          part.emplace_back();
          for (size_t k = 0; k < 3; ++k) std::copy_n(t.v[k], 3, part.back()[k].begin());
        }
      });
      const auto from = expected.begin() + static_cast<ptrdiff_t>(first);
      equal += std::equal(part.begin(), part.end(), from, from + 150);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(equal, 4);
}

TEST(GltfDraco, WhatDoesNotFitIsRefusedByName) {
  using testing::HasSubstr;
  const auto data = encode_draco(*bumpy_grid(4, false), draco::MESH_EDGEBREAKER_ENCODING, 10);
  const std::string where = "folder/scene: mesh 0: primitive 0: ";
  EXPECT_THAT(
      message_of(compressed_scene(data, 25, 96, {{"POSITION", 3}})),
      HasSubstr(where + "its Draco data have no attribute with the id 3, expected POSITION"));
  EXPECT_THAT(message_of(compressed_scene(data, 25, 96, {{"NORMAL", 0}})),
              HasSubstr("KHR_draco_mesh_compression has no POSITION"));
  SceneBuilder fan = compressed_scene(data, 25, 96);
  fan.root["meshes"][0]["primitives"][0]["mode"] = 6;
  EXPECT_THAT(message_of(fan), HasSubstr("mode 6 (fan), expected 4"));
  SceneBuilder no_indices = compressed_scene(data, 25, 96);
  no_indices.root["meshes"][0]["primitives"][0].erase("indices");
  EXPECT_THAT(message_of(no_indices), HasSubstr("expected an accessor of indices"));
  SceneBuilder no_view = compressed_scene(data, 25, 96);
  no_view.root["meshes"][0]["primitives"][0]["extensions"] = draco_extension(9, {{"POSITION", 0}});
  EXPECT_THAT(message_of(no_view), HasSubstr("bufferView 9 does not exist"));
  SceneBuilder shorts = compressed_scene(data, 25, 96);
  shorts.root["accessors"][0]["componentType"] = kI16;
  shorts.root["extensionsUsed"].push_back("KHR_mesh_quantization");
  EXPECT_THAT(message_of(shorts), HasSubstr("has floats, expected the type short"));
  auto of_version_1 = data;
  of_version_1[5] = 1;
  EXPECT_THAT(message_of(compressed_scene(of_version_1, 25, 96)), HasSubstr("version 1.2"));
  EXPECT_THAT(message_of(compressed_scene({'G', 'I', 'F', '8', '9', 'a'}, 25, 96)),
              HasSubstr("its data do not begin with the signature DRACO"));
}

// Truncated data are an error. Data with flipped bits are an error or decode to triangles.
TEST(GltfDraco, DamagedDataAreErrors) {
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const auto data = encode_draco(*bumpy_grid(6, true), method, 10);
    const auto mesh = decode_draco(data);
    const auto read = [&](const std::vector<char>& damaged) {
      return error_of_file(
          compressed_scene(damaged, mesh->num_points(), 3 * mesh->num_faces()).glb());
    };
    EXPECT_EQ(read(data).message(), "");
    for (size_t size = 0; size + 1 < data.size(); size += 1 + size / 10)
      EXPECT_NE(read({data.begin(), data.begin() + static_cast<ptrdiff_t>(size)}).message(), "")
          << size;
    std::mt19937 random(11);
    size_t refused = 0;
    for (int i = 0; i < 300; ++i) {
      auto damaged = data;
      for (int changes = 1 + i % 3; changes > 0; --changes)
        damaged[random() % damaged.size()] ^= static_cast<char>(1 << random() % 8);
      refused += !read(damaged).message().empty();
    }
    EXPECT_GT(refused, 0u);
  }
}

Error error_within(const std::string& file, uint64_t budget_bytes) {
  try {
    OpenScene(file, {}, budget_bytes).triangles();
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorCode::kInvalidInput, "");
}

// Expects that a file with huge symbol tables is refused before decoding if the tables exceed the
// budget. One byte of the file can declare 64 symbols of the entropy coder, each of which takes 12
// bytes in the tables. So the tables of a file of 400 KB would take 293 MiB.
void expect_tables_in_the_budget(const std::vector<char>& data_before_the_table) {
  std::vector<char> data = data_before_the_table;
  data.insert(data.end(), {1, 18});  // raw symbols of 18 bits
  const size_t table_bytes = 400000;
  for (size_t symbols = 64 * table_bytes; symbols > 0; symbols >>= 7)
    data.push_back(static_cast<char>((symbols & 127) | (symbols > 127 ? 128 : 0)));
  data.insert(data.end(), table_bytes, '\xff');  // each byte: 64 symbols with probability 0
  const std::string file = compressed_scene(data, 3, 3).glb();
  const Error refused = error_within(file, uint64_t{256} << 20);
  EXPECT_EQ(refused.code(), ErrorCode::kOutOfMemory);
  EXPECT_THAT(refused.message(), testing::HasSubstr("decoding its Draco data takes 296 MiB"));
  const Error damaged = error_within(file, uint64_t{512} << 20);
  EXPECT_EQ(damaged.code(), ErrorCode::kInvalidInput);
  EXPECT_THAT(damaged.message(), testing::HasSubstr("its Draco data are damaged"));
}

TEST(GltfDraco, TablesOfIndicesArePartOfTheBudget) {
  expect_tables_in_the_budget({'D', 'R', 'A', 'C', 'O', 2, 2, 1, 0, 0, 0,  // sequential
                               1, 3, 0});  // faces, vertices, compressed indices
}

// Draco allocates an object for each attribute before it decodes any attribute. A file whose
// attributes exceed the budget is refused.
TEST(GltfDraco, AttributesArePartOfTheBudget) {
  std::vector<char> data = {'D', 'R',    'A',    'C', 'O', 2, 2, 1, 0, 0, 0,  // sequential
                            1,   3,      1,      0,   1,   2,  // face, vertices, plain indices
                            1,   '\xa0', '\x8d', 6};           // one group of 100000 attributes
  for (int i = 0; i < 100000; ++i) data.insert(data.end(), {4, 9, 1, 0, 0});  // generic floats
  data.insert(data.end(), 100000, 0);                                         // their coders
  const std::string file = compressed_scene(data, 3, 3).glb();
  EXPECT_EQ(error_within(file, uint64_t{32} << 20).code(), ErrorCode::kOutOfMemory);
}

TEST(GltfDraco, TablesOfValencesArePartOfTheBudget) {
  expect_tables_in_the_budget(
      {'D',    'R', 'A', 'C', 'O', 2, 2, 1, 1, 0, 0,  // edgebreaker
       2,      3,   1,   0,   1,   0, 0,              // valences, 3 vertices, 1 face, 1 symbol
       '\x80', 1,   0,                                // bits of the first faces
       1});                                           // symbols of a valence
}

TEST(GltfDraco, TablesOfAttributesArePartOfTheBudget) {
  expect_tables_in_the_budget(
      {'D',    'R', 'A', 'C', 'O', 2, 2, 1, 0, 0, 0,  // sequential
       1,      3,   1,   0,   1,   2,                 // face, vertices, plain indices 0, 1, 2
       1,      1,   0,   9,   3,   0, 0, 2,           // one attribute: quantized positions
       '\xfe', 1});                                   // without prediction, compressed
}

// The sizes that a file declares are compared with the budget before memory is allocated.
TEST(GltfDraco, WhatDoesNotFitTheBudgetIsRefused) {
  const auto data = encode_draco(*bumpy_grid(150, false), draco::MESH_EDGEBREAKER_ENCODING, 10);
  try {
    OpenScene(compressed_scene_of(data).glb(), {}, uint64_t{6} << 20).triangles();
    FAIL() << "45000 faces decoded within 6 MiB";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
    EXPECT_THAT(error.message(), testing::HasSubstr("primitive 0: decoding its Draco data takes"));
    EXPECT_THAT(error.message(), testing::HasSubstr("give it more memory, or decompress"));
  }
}

#else

// Without the Draco library a file is refused, unless it has the same geometry uncompressed.
TEST(GltfDraco, IsRefusedWithoutTheLibrary) {
  const Error error = error_of_file(compressed_scene({'D', 'R', 'A', 'C', 'O'}, 3, 3).glb());
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  for (const char* word : {"folder/scene", "mesh 0: primitive 0", "KHR_draco_mesh_compression",
                           "libdraco-dev", "gltf-transform"})
    EXPECT_THAT(error.message(), testing::HasSubstr(word));
}

#endif

// If a file also has the geometry uncompressed, this geometry is read, with and without the
// library.
TEST(GltfDraco, AFallbackIsRead) {
  SceneBuilder scene = one_triangle();
  const auto expected = triangles_of_file(scene.glb());
  scene.root["meshes"][0]["primitives"][0]["extensions"] =
      draco_extension(scene.add_view<char>({'n', 'o', 'n', 'e'}), {{"POSITION", 0}});
  scene.root["extensionsUsed"] = {"KHR_draco_mesh_compression"};
  EXPECT_EQ(triangles_of_file(scene.glb()), expected);
}

}  // namespace
}  // namespace voxdag::test
