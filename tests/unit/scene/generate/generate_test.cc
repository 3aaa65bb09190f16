// Requirements for every generated scene: it is valid glTF, has the same bytes for the same
// options, takes little memory to generate, and its file is complete or missing.
#include "scene/generate/generate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <set>

#include "core/base/process_limits.h"
#include "scene/generate/glb_layout.h"
#include "tests/unit/scene/generate/glb.h"
#include "tests/unit/scene/generate/memory_files.h"

using namespace voxdag;

namespace {

struct Made {
  GenerateReport report;
  std::string bytes;
};

Made make(const GenerateOptions& options) {
  MemoryFiles files;
  NoProgress progress;
  const CancelToken cancel;
  Made made;
  made.report = generate_scene(files, "out/scene.glb", options, progress, cancel);
  EXPECT_EQ(files.files.size(), 1u);
  made.bytes = files.files.at("out/scene.glb");
  return made;
}

uint64_t fnv1a(const std::string& bytes) {
  uint64_t h = 0xcbf29ce484222325u;
  for (const unsigned char c : bytes) h = (h ^ c) * 0x100000001b3u;
  return h;
}

GenerateOptions small(SceneKind kind, bool instances = false) {
  GenerateOptions options;
  options.kind = kind;
  options.level = 2;
  options.triangles = kind == SceneKind::kMenger ? 0 : 20'000;
  options.instances = instances;
  return options;
}

// Returns the value of a line of /proc/self/status, in kilobytes.
uint64_t status_kb(const std::string& name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind(name, 0) == 0) return std::stoull(line.substr(name.size() + 1));
  return 0;
}

class EveryKind : public testing::TestWithParam<SceneKind> {};

// The file is valid glTF with as many triangles as reported, all finite.
TEST_P(EveryKind, IsValidGltf) {
  const Made made = make(small(GetParam()));
  EXPECT_EQ(made.report.bytes, made.bytes.size());
  const glb::File file(made.bytes);
  const auto triangles = file.triangles();
  EXPECT_EQ(made.report.triangles, triangles.size());
  EXPECT_EQ(made.report.stored_triangles, triangles.size());
  EXPECT_GT(triangles.size(), 0u);
  for (const auto& t : triangles)
    for (const auto& p : t)
      for (const float c : p) ASSERT_TRUE(std::isfinite(c));
}

TEST_P(EveryKind, SameSeedSameBytes) {
  EXPECT_EQ(make(small(GetParam())).bytes, make(small(GetParam())).bytes);
}

// Another seed gives another scene, except for the sponge, which has nothing random.
TEST_P(EveryKind, AnotherSeedAnotherScene) {
  GenerateOptions options = small(GetParam());
  const Made first = make(options);
  options.seed = 2;
  EXPECT_EQ(make(options).bytes == first.bytes, GetParam() == SceneKind::kMenger);
}

// A scene that is too large for one primitive is divided into several primitives. None of them has
// too many vertices.
TEST_P(EveryKind, LargeScenesAreSplitIntoBlocks) {
  GenerateOptions options = small(GetParam());
  options.level = 3;
  if (GetParam() != SceneKind::kMenger) options.triangles = 300'000;
  const Made made = make(options);
  const glb::File file(made.bytes);
  EXPECT_EQ(file.triangles().size(), made.report.triangles);
  size_t primitives = 0;
  for (const auto& mesh : file.json["meshes"])
    for (const auto& p : mesh["primitives"]) {
      ++primitives;
      EXPECT_LE(file.json["accessors"][p["attributes"]["POSITION"].get<size_t>()]["count"], 65535);
    }
  EXPECT_GT(primitives, 1u);
}

// If the file cannot be written, no file remains, and the error gives the reason.
TEST_P(EveryKind, AFullDiskLeavesNothing) {
  MemoryFiles files;
  files.capacity = 10'000;
  NoProgress progress;
  const CancelToken cancel;
  try {
    generate_scene(files, "scene.glb", small(GetParam()), progress, cancel);
    FAIL() << "expected kNoSpace";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
  }
  EXPECT_TRUE(files.files.empty());
}

TEST_P(EveryKind, CancelingLeavesNothing) {
  MemoryFiles files;
  NoProgress progress;
  CancelToken cancel;
  cancel.cancel();
  EXPECT_THROW(generate_scene(files, "scene.glb", small(GetParam()), progress, cancel), Error);
  EXPECT_TRUE(files.files.empty());
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryKind,
                         testing::Values(SceneKind::kCity, SceneKind::kMenger, SceneKind::kTerrain,
                                         SceneKind::kSoup, SceneKind::kSpheres),
                         [](const auto& test) { return std::string(scene_kind(test.param).name); });

// The bytes are the same on every machine and with every compiler. Users store results of builds of
// these scenes, so a change of the bytes must be announced.
TEST(GenerateGolden, DigestsOfEveryKind) {
  const struct {
    GenerateOptions options;
    uint64_t digest;
  } golden[] = {
      {small(SceneKind::kCity), 0x32614b9c6beee639u},
      {small(SceneKind::kCity, true), 0x6c71fd66a4ca2af7u},
      {small(SceneKind::kMenger), 0x1a9401c8cef0f251u},
      {small(SceneKind::kTerrain), 0x403528e5958c9eb9u},
      {small(SceneKind::kSoup), 0x4fb927f6cd915798u},
      {small(SceneKind::kSpheres), 0xa4fde24cb6ae552fu},
      {small(SceneKind::kSpheres, true), 0x6e36aca24f3b4400u},
  };
  for (const auto& g : golden) {
    SCOPED_TRACE(std::string(scene_kind(g.options.kind).name) +
                 (g.options.instances ? ", instances" : ""));
    EXPECT_EQ(fnv1a(make(g.options).bytes), g.digest);
  }
}

// A city that is written as instances has the same triangles to the last bit, and its file is much
// smaller.
TEST(GenerateInstances, ACityOfInstancesIsTheSameCity) {
  const Made plain = make(small(SceneKind::kCity)), shared = make(small(SceneKind::kCity, true));
  EXPECT_EQ(plain.report.triangles, shared.report.triangles);
  EXPECT_GT(shared.report.instances, 100u);
  EXPECT_LT(shared.bytes.size(), plain.bytes.size() / 4);
  auto a = glb::File(plain.bytes).triangles(), b = glb::File(shared.bytes).triangles();
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  EXPECT_TRUE(a == b);
}

// The colors are the vertex colors times the material's color. The triangles are the same as
// without colors.
TEST(GenerateColors, ACityWithColorsIsTheSameCity) {
  GenerateOptions options = small(SceneKind::kCity);
  const Made plain = make(options);
  options.colors = true;
  const Made colored = make(options);
  EXPECT_EQ(fnv1a(colored.bytes), 0x885dbacad3eaa635u);
  const glb::File file(colored.bytes);
  auto a = glb::File(plain.bytes).triangles(), b = file.triangles();
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  EXPECT_TRUE(a == b);
  ASSERT_EQ(file.json["materials"].size(), 4u);
  std::set<std::array<uint8_t, 4>> colors;
  std::set<size_t> materials;
  for (const auto& mesh : file.json["meshes"])
    for (const auto& p : mesh["primitives"]) {
      const size_t positions = p["attributes"]["POSITION"], of = p["attributes"]["COLOR_0"];
      materials.insert(p["material"].get<size_t>());
      EXPECT_EQ(file.json["accessors"][of]["normalized"], true);
      const auto found = file.elements<std::array<uint8_t, 4>>(of, 5121, "VEC4");
      EXPECT_EQ(file.json["accessors"][positions]["count"], found.size());
      colors.insert(found.begin(), found.end());
    }
  EXPECT_EQ(materials.size(), 4u);
  EXPECT_GT(colors.size(), 30u);
  EXPECT_FALSE(glb::File(plain.bytes).json.contains("materials"));
}

TEST(GenerateInstances, SpheresHaveAsManyTriangles) {
  const Made plain = make(small(SceneKind::kSpheres));
  const Made shared = make(small(SceneKind::kSpheres, true));
  EXPECT_EQ(plain.report.triangles, shared.report.triangles);
  EXPECT_EQ(glb::File(shared.bytes).triangles().size(), shared.report.triangles);
  EXPECT_GT(shared.report.instances, 10u);
}

// Soup has exactly the requested number of triangles. Among them are points (three equal corners),
// triangles with two equal corners, triangles in planes of constant x, and very large triangles.
TEST(GenerateSoup, HoldsDegeneratesAndSlivers) {
  GenerateOptions options = small(SceneKind::kSoup);
  options.triangles = 50'007;
  const auto triangles = glb::File(make(options).bytes).triangles();
  EXPECT_EQ(triangles.size(), options.triangles);
  int points = 0, doubles = 0, flat = 0, wide = 0;
  for (const auto& [a, b, c] : triangles) {
    points += a == b && b == c;
    doubles += (a == c) != (b == c);
    flat += a[0] == b[0] && b[0] == c[0] && !(a == b);
    wide += std::fabs(a[0] - b[0]) > 300 && std::fabs(a[1] - c[1]) > 300;
  }
  EXPECT_GT(points, 100);
  EXPECT_GT(doubles, 100);
  EXPECT_GT(flat, 100);
  EXPECT_GT(wide, 5);
}

// A terrain is one connected, square sheet, the largest with at most the requested number of
// triangles. Neighboring tiles have equal heights where they meet.
TEST(GenerateTerrain, IsASquareWithoutGaps) {
  GenerateOptions options = small(SceneKind::kTerrain);
  options.triangles = 2 * 300 * 300 + 5;
  const auto triangles = glb::File(make(options).bytes).triangles();
  EXPECT_EQ(triangles.size(), 2u * 300 * 300);
  std::map<std::pair<float, float>, float> heights;
  for (const auto& t : triangles)
    for (const auto& p : t) {
      const auto [at, is_new] = heights.try_emplace({p[0], p[2]}, p[1]);
      ASSERT_EQ(at->second, p[1]);
    }
  EXPECT_EQ(heights.size(), 301u * 301);
}

// Cities and spheres have about the requested number of triangles: it differs from the request by
// at most a quarter.
TEST(GenerateSize, IsAboutWhatWasAsked) {
  for (SceneKind kind : {SceneKind::kCity, SceneKind::kSpheres}) {
    SCOPED_TRACE(scene_kind(kind).name);
    GenerateOptions options = small(kind);
    options.triangles = 1'000'000;
    EXPECT_NEAR(static_cast<double>(make(options).report.triangles), 1e6, 2.5e5);
  }
}

// A scene of 50 MB is written through a buffer of 1 MB, so memory does not grow with the scene.
TEST(GenerateMemory, StaysSmallForALargeScene) {
  if (VOXDAG_SANITIZED) GTEST_SKIP() << "sanitizers retain freed memory";
  MemoryFiles files;
  files.keep = false;
  NoProgress progress;
  const CancelToken cancel;
  GenerateOptions options = small(SceneKind::kCity);
  options.triangles = 4'000'000;
  std::ofstream("/proc/self/clear_refs") << 5;  // VmHWM starts again from here
  const uint64_t before = status_kb("VmHWM:");
  const GenerateReport report = generate_scene(files, "scene.glb", options, progress, cancel);
  EXPECT_GT(report.bytes, 50'000'000u);
  EXPECT_EQ(files.written, report.bytes);
  EXPECT_LE(files.largest_write, 1u << 20);
  EXPECT_LT(status_kb("VmHWM:"), before + 8 * 1024);
}

ErrorCode refusal(const GenerateOptions& options) {
  MemoryFiles files;
  NoProgress progress;
  const CancelToken cancel;
  try {
    generate_scene(files, "scene.glb", options, progress, cancel);
  } catch (const Error& error) {
    EXPECT_EQ(files.written, 0u);
    return error.code();
  }
  ADD_FAILURE() << "expected an error";
  return ErrorCode::kIo;
}

// A scene that cannot fit in a .glb file in any encoding is refused immediately.
TEST(GenerateLimit, MoreThanAGlbHoldsIsRefused) {
  GenerateOptions menger = small(SceneKind::kMenger);
  menger.level = 6;
  EXPECT_EQ(refusal(menger), ErrorCode::kLimit);
  GenerateOptions terrain = small(SceneKind::kTerrain);
  terrain.triangles = 1'000'000'000'000;
  EXPECT_EQ(refusal(terrain), ErrorCode::kLimit);
}

// If the size of a scene is known only after counting its meshes, counting stops with an error when
// the size exceeds the limit. The message gives the limit.
TEST(GenerateLimit, CountingStopsAtTheLimit) {
  MeshBuilder full;
  while (full.vertices() < MeshBuilder::kMaxVertices) full.add_vertex({1, 2, 3});
  for (uint32_t i = 0; i < MeshBuilder::kMaxTriangles; ++i) full.add_triangle(0, 1, 2);
  const uint64_t block_bytes =
      12ull * MeshBuilder::kMaxVertices + 6ull * MeshBuilder::kMaxTriangles;
  NoProgress progress;
  const CancelToken never;
  GlbLayout layout(progress, never);
  for (uint64_t i = 0; i < kMaxGlbBytes / block_bytes; ++i) layout.mesh(full);
  try {
    layout.mesh(full);
    FAIL() << "expected kLimit";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kLimit);
    EXPECT_NE(error.message().find("4 294 967 295"), std::string::npos);
  }
}

// An option that does not apply to the kind of scene is refused, and so is an unknown kind.
TEST(GenerateOptions, WhatDoesNotApplyIsRefused) {
  EXPECT_EQ(refusal(small(SceneKind::kSoup, true)), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(small(SceneKind::kTerrain, true)), ErrorCode::kInvalidInput);
  GenerateOptions colored = small(SceneKind::kSpheres);
  colored.colors = true;
  EXPECT_EQ(refusal(colored), ErrorCode::kInvalidInput);
  colored = small(SceneKind::kCity, true);
  colored.colors = true;
  EXPECT_EQ(refusal(colored), ErrorCode::kInvalidInput);
  GenerateOptions menger = small(SceneKind::kMenger);
  menger.triangles = 100;
  EXPECT_EQ(refusal(menger), ErrorCode::kInvalidInput);
  EXPECT_THROW(scene_kind("village"), Error);
}

}  // namespace
