// EXT_meshopt_compression and KHR_meshopt_compression: a scene with compressed views gives the same
// triangles as a scene that stores the decoded bytes uncompressed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/scene/compressed/meshopt_scenes.h"
#include "tests/unit/scene/compressed/vertex_stream_writer.h"

namespace voxdag::test {
namespace {

#ifdef VOXDAG_HAS_MESHOPT

constexpr uint32_t kSide = 60;  // vertices along each side of the grid

std::vector<unsigned char> encode_triangles(const std::vector<uint32_t>& indices) {
  std::vector<unsigned char> out(meshopt_encodeIndexBufferBound(indices.size(), kSide * kSide));
  out.resize(meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}

std::vector<unsigned char> encode_sequence(const std::vector<uint32_t>& indices) {
  std::vector<unsigned char> out(meshopt_encodeIndexSequenceBound(indices.size(), kSide * kSide));
  out.resize(meshopt_encodeIndexSequence(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}

// Returns the indices after encoding and decoding them. The codec can rotate the corners of
// triangles, so a scene with uncompressed indices has equal triangles only if it stores the decoded
// indices.
std::vector<uint32_t> turned(const std::vector<uint32_t>& indices) {
  const auto bytes = encode_triangles(indices);
  std::vector<uint32_t> out(indices.size());
  EXPECT_EQ(meshopt_decodeIndexBuffer(out.data(), out.size(), bytes.data(), bytes.size()), 0);
  return out;
}

std::vector<uint32_t> grid_triangles() {
  std::vector<uint32_t> all;
  for (uint32_t y = 0; y + 1 < kSide; ++y)
    for (uint32_t x = 0; x + 1 < kSide; ++x) {
      const uint32_t v = y * kSide + x;
      all.insert(all.end(), {v, v + 1, v + kSide, v + 1, v + kSide + 1, v + kSide});
    }
  return all;
}

// Returns the positions of a grid's vertices, each followed by `extra` unused components.
template <class T>
std::vector<T> grid_positions(size_t extra) {
  std::vector<T> all;
  std::mt19937 random(5);
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x) {
      for (const uint32_t c : {13 * x, 11 * y, static_cast<uint32_t>(random() % 200)})
        all.push_back(static_cast<T>(c) / (std::is_floating_point_v<T> ? T{7} : T{1}));
      all.insert(all.end(), extra, T{1});
    }
  return all;
}

SceneBuilder compressed_grid(const std::vector<unsigned char>& positions,
                             const std::vector<unsigned char>& triangles, size_t index_bytes,
                             Json of_positions = Json::object(),
                             Json of_triangles = Json::object()) {
  SceneBuilder scene;
  const size_t count = kSide * kSide, corners = 6 * (kSide - 1) * (kSide - 1);
  const int p = add_compressed(scene, positions, count, 12, "ATTRIBUTES", std::move(of_positions));
  const int t =
      add_compressed(scene, triangles, corners, index_bytes, "TRIANGLES", std::move(of_triangles));
  draw(scene, add_accessor_of(scene, p, kF32, count, "VEC3"),
       add_accessor_of(scene, t, index_bytes == 2 ? kU16 : kU32, corners, "SCALAR"));
  return scene;
}

TEST(GltfMeshopt, EqualsTheDecodedScene) {
  const auto positions = grid_positions<float>(0);
  const auto triangles = grid_triangles();
  SceneBuilder plain;
  draw(plain, plain.add_positions(positions),
       plain.add_accessor("SCALAR", kU32, turned(triangles)));
  const auto expected = triangles_of_file(plain.glb());
  for (const size_t index_bytes : {2u, 4u}) {
    const auto scene =
        compressed_grid(encode_vertices(positions, 12), encode_triangles(triangles), index_bytes);
    EXPECT_EQ(triangles_of_file(meshopt_glb(scene)), expected) << index_bytes;
    EXPECT_EQ(triangles_of_file(khr_meshopt_glb(scene)), expected) << index_bytes;
  }
}

// The data are in the form that gltfpack writes: 16-bit positions with KHR_mesh_quantization, and
// the indices of a strip, encoded as a sequence.
TEST(GltfMeshopt, QuantizedPositionsAndStrips) {
  const auto positions = grid_positions<uint16_t>(1);
  std::vector<uint32_t> strip;
  for (uint32_t x = 0; x < kSide; ++x) strip.insert(strip.end(), {x, x + kSide});
  SceneBuilder plain, compressed;
  const size_t count = kSide * kSide;
  const int p = plain.add_view(positions, {{"byteStride", 8}});
  draw(plain, add_accessor_of(plain, p, kU16, count, "VEC3"),
       plain.add_accessor("SCALAR", kU32, strip), 5);
  const int q = add_compressed(compressed, encode_vertices(positions, 8), count, 8, "ATTRIBUTES");
  const int s = add_compressed(compressed, encode_sequence(strip), strip.size(), 4, "INDICES");
  draw(compressed, add_accessor_of(compressed, q, kU16, count, "VEC3"),
       add_accessor_of(compressed, s, kU32, strip.size(), "SCALAR"), 5);
  for (SceneBuilder* scene : {&plain, &compressed})
    scene->root["extensionsUsed"] = {"KHR_mesh_quantization"};
  const auto triangles = triangles_of_file(meshopt_glb(compressed));
  EXPECT_EQ(triangles.size(), 2u * kSide - 2);
  EXPECT_EQ(triangles, triangles_of_file(plain.glb()));
}

// The filter EXPONENTIAL is decoded: 24 bits of mantissa are below 8 bits of exponent.
TEST(GltfMeshopt, ExponentialFilter) {
  std::vector<uint32_t> encoded;
  std::vector<float> decoded;
  std::mt19937 random(3);
  for (size_t i = 0; i < 3 * kSide * kSide; ++i) {
    const int mantissa = static_cast<int>(random() % 20000) - 10000;
    const int exponent = static_cast<int>(random() % 20) - 15;
    encoded.push_back(static_cast<uint32_t>(exponent) << 24 |
                      (static_cast<uint32_t>(mantissa) & 0xffffff));
    decoded.push_back(std::ldexp(static_cast<float>(mantissa), exponent));
  }
  const auto triangles = grid_triangles();
  SceneBuilder plain;
  draw(plain, plain.add_positions(decoded), plain.add_accessor("SCALAR", kU32, turned(triangles)));
  const auto compressed = compressed_grid(encode_vertices(encoded, 12), encode_triangles(triangles),
                                          4, {{"filter", "EXPONENTIAL"}});
  EXPECT_EQ(triangles_of_file(meshopt_glb(compressed)), triangles_of_file(plain.glb()));
}

// Streams of version 1 are decoded with every version of the library.
TEST(GltfMeshopt, VertexStreamsOfVersion1) {
  const auto positions = grid_positions<float>(0);
  const auto triangles = grid_triangles();
  SceneBuilder plain;
  draw(plain, plain.add_positions(positions),
       plain.add_accessor("SCALAR", kU32, turned(triangles)));
  const std::string bytes(reinterpret_cast<const char*>(positions.data()),
                          positions.size() * sizeof(float));
  const auto scene = compressed_grid(write_vertex_stream_1(bytes, 12, {0x42, 1, 0}, 1),
                                     encode_triangles(triangles), 4);
  EXPECT_EQ(triangles_of_file(khr_meshopt_glb(scene)), triangles_of_file(plain.glb()));
}

// The filter COLOR is decoded: from Y, Co, Cg and alpha to red, green, blue and alpha.
TEST(GltfMeshopt, ColorFilter) {
  const auto read = [](int view, SceneBuilder& scene, int type, const std::string& file) {
    Json& primitive = scene.root["meshes"][0]["primitives"][0];
    primitive["attributes"]["COLOR_0"] = scene.add("accessors", {{"bufferView", view},
                                                                 {"componentType", type},
                                                                 {"normalized", true},
                                                                 {"count", 3},
                                                                 {"type", "VEC4"}});
    std::vector<std::array<uint32_t, 4>> colors;
    OpenScene open(file == "KHR" ? khr_meshopt_glb(scene) : meshopt_glb(scene));
    const SurfaceTriangle triangle = surfaces_of(*open.source)[0];
    for (const SurfaceCorner& corner : triangle.corners)
      colors.push_back({corner.color[0], corner.color[1], corner.color[2], corner.color[3]});
    EXPECT_TRUE(open.source->materials().warnings.list().empty());
    return colors;
  };
  const auto compressed = [&](const auto& values, int type, const char* file) {
    SceneBuilder scene = one_triangle();
    const size_t stride = 4 * sizeof(values[0]);
    const int view = add_compressed(scene, encode_vertices(values, stride), 3, stride, "ATTRIBUTES",
                                    {{"filter", "COLOR"}});
    return read(view, scene, type, file);
  };
  const auto plain = [&](const auto& values, int type) {
    SceneBuilder scene = one_triangle();
    return read(scene.add_view(values), scene, type, "EXT");
  };
  // Three colors with 8, 6 and 2 bits per component. A color is Y, Co, Cg and alpha. The highest
  // set bit of the last byte marks the number of bits; the bits below it are alpha.
  const std::vector<uint8_t> encoded8 = {100, 30, 0xec, 0xff, 31, 0, 0, 0x20, 3, 0, 0, 2};
  const std::vector<uint8_t> decoded8 = {150, 80, 90, 255, 125, 125, 125, 0, 255, 255, 255, 0};
  EXPECT_EQ(compressed(encoded8, kU8, "KHR"), plain(decoded8, kU8));
  EXPECT_EQ(compressed(encoded8, kU8, "EXT"), plain(decoded8, kU8));
  // Three colors with 16, 12 and 8 bits per component.
  const std::vector<uint16_t> encoded16 = {40000, 100,   0xff9c, 0xc000, 4095, 0,
                                           0,     0xfff, 128,    0,      0,    0x80};
  const std::vector<uint16_t> decoded16 = {40200, 39900, 40000, 32768, 65535, 65535,
                                           65535, 65535, 32896, 32896, 32896, 0};
  EXPECT_EQ(compressed(encoded16, kU16, "KHR"), plain(decoded16, kU16));
}

// The filter QUATERNION is decoded: rotations of instances become quaternions of 16 bits.
TEST(GltfMeshopt, QuaternionFilterOfInstances) {
  const std::vector<int16_t> encoded{100, 200, -300, 0x7ff0 | 3, -500, 0, 900, 0x7ff0 | 1};
  std::vector<int16_t> decoded = encoded;
  meshopt_decodeFilterQuat(decoded.data(), 2, 8);
  SceneBuilder plain = one_triangle(), compressed = one_triangle();
  const auto instance = [](SceneBuilder& scene, int view) {
    scene.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["ROTATION"] =
        scene.add("accessors", {{"bufferView", view},
                                {"componentType", kI16},
                                {"normalized", true},
                                {"count", 2},
                                {"type", "VEC4"}});
    scene.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  };
  instance(plain, plain.add_view(decoded));
  instance(compressed, add_compressed(compressed, encode_vertices(encoded, 8), 2, 8, "ATTRIBUTES",
                                      {{"filter", "QUATERNION"}}));
  const auto triangles = triangles_of_file(meshopt_glb(compressed));
  EXPECT_EQ(triangles.size(), 2u);
  EXPECT_EQ(triangles, triangles_of_file(plain.glb()));
}

std::string message_of_glb(std::string file, ErrorCode code = ErrorCode::kInvalidInput) {
  const Error error = error_of_file(std::move(file));
  EXPECT_EQ(error.code(), code) << error.message();
  return error.message();
}

TEST(GltfMeshopt, WhatDoesNotFitIsRefusedByName) {
  using testing::HasSubstr;
  const auto positions = encode_vertices(grid_positions<float>(0), 12);
  const auto triangles = encode_triangles(grid_triangles());
  const auto with = [&](const Json& of_positions, const Json& of_triangles) {
    return message_of_glb(
        meshopt_glb(compressed_grid(positions, triangles, 4, of_positions, of_triangles)));
  };
  const Json same = Json::object();
  EXPECT_THAT(with({{"mode", "POINTS"}}, same), HasSubstr("expected ATTRIBUTES, TRIANGLES or"));
  EXPECT_THAT(with({{"filter", "ROUND"}}, same), HasSubstr("filter is ROUND, expected NONE"));
  EXPECT_THAT(with({{"filter", "QUATERNION"}}, same),
              HasSubstr("byteStride is 12, expected 8, as QUATERNION requires"));
  EXPECT_THAT(with({{"filter", "OCTAHEDRAL"}}, same), HasSubstr("expected 4 or 8, as OCTAHEDRAL"));
  EXPECT_THAT(with({{"filter", "COLOR"}}, same), HasSubstr("expected 4 or 8, as COLOR"));
  EXPECT_THAT(with({{"byteStride", 10}}, same),
              HasSubstr("is 10, expected a multiple of 4 from 4 to 256"));
  EXPECT_THAT(with({{"byteStride", 16}}, same), HasSubstr("has byteStride 12: expected 16, the"));
  EXPECT_THAT(with({{"count", 3599}}, same),
              HasSubstr("has byteLength 43200: expected at most 43188"));
  EXPECT_THAT(with({{"buffer", 7}}, same), HasSubstr("EXT_meshopt_compression: buffer 7"));
  EXPECT_THAT(with({{"byteLength", 1 << 20}}, same), HasSubstr("ends past the"));
  EXPECT_THAT(with({{"buffer", 1}}, same), HasSubstr("buffer 1 has no uri"));
  EXPECT_THAT(with({{"byteLength", 1000}}, same), HasSubstr("do not hold 3600 elements"));
  EXPECT_THAT(with(same, {{"byteStride", 3}}),
              HasSubstr("byteStride is 3, expected 2 or 4, the sizes of indices"));
  EXPECT_THAT(with(same, {{"count", 20887}}), HasSubstr("is 20887, expected a multiple of three"));
  EXPECT_THAT(with(same, {{"filter", "EXPONENTIAL"}}),
              HasSubstr("expected one only for ATTRIBUTES"));
  EXPECT_THAT(with(same, {{"mode", "INDICES"}}), HasSubstr("do not hold 20886 elements"));
}

// Truncated or changed data give either triangles or an error.
TEST(GltfMeshopt, DamagedDataAreErrors) {
  const auto positions = encode_vertices(grid_positions<float>(0), 12);
  const auto triangles = encode_triangles(grid_triangles());
  const auto read = [&](const auto& p, const auto& t) {
    return error_of_file(meshopt_glb(compressed_grid(p, t, 2))).message();
  };
  EXPECT_EQ(read(positions, triangles), "");
  for (size_t cut : {1u, 30u, 400u, 2000u}) {
    EXPECT_NE(read(std::vector(positions.begin(), positions.end() - static_cast<ptrdiff_t>(cut)),
                   triangles),
              "");
    EXPECT_NE(read(positions,
                   std::vector(triangles.begin(), triangles.end() - static_cast<ptrdiff_t>(cut))),
              "");
  }
  std::mt19937 random(2);
  size_t refused = 0;
  for (int i = 0; i < 100; ++i) {
    auto p = positions;
    auto t = triangles;
    p[random() % p.size()] ^= static_cast<unsigned char>(1 << random() % 8);
    t[random() % t.size()] ^= static_cast<unsigned char>(1 << random() % 8);
    refused += !read(p, t).empty();
  }
  EXPECT_GT(refused, 0u);
}

// A few bytes can declare a huge count. A file with such a count is refused before memory is
// allocated.
TEST(GltfMeshopt, WhatDoesNotFitTheBudgetIsRefused) {
  SceneBuilder scene;
  const size_t count = size_t{1} << 24;
  const int p =
      add_compressed(scene, encode_vertices(std::vector<float>(30), 12), count, 12, "ATTRIBUTES");
  draw(scene, add_accessor_of(scene, p, kF32, count, "VEC3"),
       scene.add_accessor<uint16_t>("SCALAR", kU16, {0, 1, 2}));
  const std::string message = message_of_glb(meshopt_glb(scene), ErrorCode::kOutOfMemory);
  EXPECT_THAT(message, testing::HasSubstr("folder/scene: EXT_meshopt_compression of 16777216"));
  EXPECT_THAT(message, testing::HasSubstr("decoded geometry needs 192.00 MiB"));
  EXPECT_THAT(message, testing::HasSubstr("give it more memory, or decompress the file first"));
}

#else

// Without the meshopt library a file is refused, unless it has the same geometry uncompressed.
TEST(GltfMeshopt, IsRefusedWithoutTheLibrary) {
  SceneBuilder scene;
  const int p = add_compressed(scene, {1, 2, 3}, 3, 12, "ATTRIBUTES");
  draw(scene, add_accessor_of(scene, p, kF32, 3, "VEC3"),
       scene.add_accessor<uint16_t>("SCALAR", kU16, {0, 1, 2}));
  const Error error = error_of_file(meshopt_glb(scene));
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  for (const char* word : {"folder/scene", "mesh 0: primitive 0", "EXT_meshopt_compression",
                           "libmeshoptimizer-dev", "gltf-transform"})
    EXPECT_THAT(error.message(), testing::HasSubstr(word));
}

#endif

// Compressed views that no drawn mesh uses are not checked, so they can have any fault.
TEST(GltfMeshopt, UnusedViewsMayBeBroken) {
  SceneBuilder scene = one_triangle();
  const auto expected = triangles_of_file(scene.glb());
  add_compressed(scene, {1, 2, 3}, 3, 12, "ATTRIBUTES", {{"byteLength", 1 << 20}});
  add_compressed(scene, {1, 2, 3}, 3, 12, "ATTRIBUTES", {{"count", 1}});
  EXPECT_EQ(triangles_of_file(meshopt_glb(scene)), expected);
  EXPECT_EQ(triangles_of_file(khr_meshopt_glb(scene)), expected);
}

// If a view's own buffer has the uncompressed bytes, they are read, with and without the library.
TEST(GltfMeshopt, AFallbackIsRead) {
  SceneBuilder scene = one_triangle();
  const auto expected = triangles_of_file(scene.glb());
  const Json broken = {
      {"buffer", 0}, {"byteLength", 3}, {"byteStride", 12}, {"count", 3}, {"mode", "ATTRIBUTES"}};
  for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    SceneBuilder with_extension = scene;
    with_extension.root["bufferViews"][0]["extensions"][name] = broken;
    with_extension.root["extensionsUsed"] = {name};
    OpenScene open(with_extension.glb());
    EXPECT_EQ(open.triangles(), expected);
    EXPECT_TRUE(open.source->warnings().empty());
    with_extension.root["extensionsRequired"] = {name};
    EXPECT_EQ(triangles_of_file(with_extension.glb()), expected);
  }
}

}  // namespace
}  // namespace voxdag::test
