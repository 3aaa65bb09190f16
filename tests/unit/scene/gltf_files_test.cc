// The containers of a scene (GLB and JSON), and reading a scene in windows within a memory budget.
#include <gtest/gtest.h>

#include <random>

#include "scene/gltf/document/read_document.h"
#include "scene/gltf/document/tinygltf.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

void put_u32(std::string& bytes, size_t offset, uint32_t value) {
  bytes.replace(offset, 4, little_endian(value));
}

// A GLB truncated anywhere is refused, and nothing is read past its end.
TEST(GltfContainer, EveryTruncationIsRefused) {
  const std::string whole = one_triangle().glb();
  for (size_t size = 0; size < whole.size(); ++size) {
    const Error error = error_of_file(whole.substr(0, size));
    ASSERT_EQ(error.code(), ErrorCode::kInvalidInput) << size;
    ASSERT_NE(error.message(), "") << size;
  }
}

// Headers whose lengths contradict each other are refused.
TEST(GltfContainer, LyingHeaders) {
  const std::string whole = one_triangle().glb();
  const auto with = [&](size_t offset, uint32_t value) {
    std::string bytes = whole;
    put_u32(bytes, offset, value);
    return error_of_file(bytes).message();
  };
  EXPECT_NE(with(4, 1).find("GLB version 1, expected version 2"), std::string::npos);
  EXPECT_NE(with(8, 0xffffffff).find("cut off"), std::string::npos);
  EXPECT_NE(with(8, 3).find("declares a GLB length of 3 bytes"), std::string::npos);
  EXPECT_NE(with(8, 15).find("inside the header of a chunk"), std::string::npos);
  EXPECT_NE(with(12, 0xfffffff0).find("the GLB chunk at byte 12 declares"), std::string::npos);
  EXPECT_NE(with(16, 0x004E4942).find("not JSON"), std::string::npos);
  EXPECT_NE(with(0, 0x58585858).find("has an unknown format"), std::string::npos);
}

// Bytes after the length given in the header, and a BIN chunk that is longer than its buffer, are
// ignored.
TEST(GltfContainer, TrailingBytes) {
  EXPECT_EQ(triangles_of_file(one_triangle().glb() + "trailing").size(), 1u);
  SceneBuilder scene = one_triangle();
  scene.bin += "xyz";
  EXPECT_EQ(triangles_of_file(scene.glb()).size(), 1u);
}

// Returns a GLB with these chunks after its JSON.
std::string glb_with_chunks(std::string json,
                            const std::vector<std::pair<std::string, std::string>>& chunks) {
  std::string body = little_endian(static_cast<uint32_t>(json.size())) + "JSON" + json;
  for (const auto& [type, content] : chunks)
    body += little_endian(static_cast<uint32_t>(content.size())) + type + content;
  return "glTF" + little_endian(2) + little_endian(static_cast<uint32_t>(12 + body.size())) + body;
}

// Chunks of unknown types can be anywhere after the JSON. Up to seven zeros or blanks after the
// last chunk are padding. Other bytes there are an error.
TEST(GltfContainer, OtherChunks) {
  SceneBuilder scene = one_triangle();
  scene.root["buffers"] = {{{"byteLength", scene.bin.size()}}};
  const std::string json = scene.root.dump(), bin_type("BIN\0", 4), &bin = scene.bin;
  EXPECT_EQ(
      triangles_of_file(glb_with_chunks(json, {{"XTRA", "12345678"}, {bin_type, bin}})).size(), 1u);
  EXPECT_EQ(
      triangles_of_file(
          glb_with_chunks(json, {{"XTRA", ""}, {"MORE", "1"}, {bin_type, bin}, {"LAST", "x"}}))
          .size(),
      1u);
  // The header of the JSON chunk can give its length without the padding.
  const std::string padded = json + std::string(4 - json.size() % 4, ' ');
  std::string glb = glb_with_chunks(padded, {{bin_type, bin}});
  put_u32(glb, 12, static_cast<uint32_t>(json.size()));
  EXPECT_EQ(triangles_of_file(glb).size(), 1u);
  const std::string empty = R"({"asset":{"version":"2.0"}})";
  for (const std::string& padding : {std::string(3, '\0'), std::string("   ")}) {
    std::string file = glb_with_chunks(empty, {}) + padding;
    put_u32(file, 8, static_cast<uint32_t>(file.size()));
    EXPECT_EQ(error_of_file(file).message(), "");
  }
  std::string cut = glb_with_chunks(empty, {}) + "BIN";
  put_u32(cut, 8, static_cast<uint32_t>(cut.size()));
  EXPECT_NE(error_of_file(cut).message().find("inside the header of a chunk"), std::string::npos);
}

// The JSON can begin with a byte order mark, and end with zeros or white space.
TEST(GltfContainer, PaddedJson) {
  SceneBuilder scene = one_triangle();
  scene.root["buffers"] = {{{"byteLength", scene.bin.size()}}};
  const std::string bin_type("BIN\0", 4);
  for (const std::string& json :
       {scene.root.dump() + std::string(3, '\0'), scene.root.dump() + std::string(5000, '\0'),
        "\xef\xbb\xbf" + scene.root.dump() + " \r\n", " \n" + scene.root.dump() + "\n"}) {
    EXPECT_EQ(triangles_of_file(glb_with_chunks(json, {{bin_type, scene.bin}})).size(), 1u);
  }
  const std::string text = scene.gltf("data:;base64," + base64(scene.bin));
  EXPECT_EQ(triangles_of_file("\xef\xbb\xbf" + text + std::string(7, '\0')).size(), 1u);
  EXPECT_NE(error_of_file(text + "x").message(), "");
}

// NaN and infinities, in the spellings of several programs, are read as null. This is an error only
// if the reader needs the number.
TEST(GltfNumbers, NotFinite) {
  const std::string json = one_triangle().gltf("data:;base64," + base64(one_triangle().bin));
  const auto with = [&](const std::string& member) {
    std::string text = json;
    text.insert(text.find("\"bufferView\":0"), member + ",");
    return text;
  };
  for (const char* number :
       {"NaN",       "-NaN",    "nan",  "-nan(ind)", "nan(snan)", "Infinity", "-Infinity",
        "+Infinity", "inf",     "-inf", "INF",       "1.#QNAN",   "-1.#IND",  "1.#INF",
        "-1.#INF00", "1.#IND0", "null", "-1.5",      "1.5",       "10",       "-1"}) {
    SCOPED_TRACE(number);
    const std::string text = number;
    for (const std::string& member : {"\"max\":[" + text + ",2,3]", "\"min\":[0," + text + "]",
                                      "\"max\": [ " + text + " ]", "\"extras\":" + text}) {
      EXPECT_EQ(triangles_of_file(with(member)).size(), 1u) << member;
      // Moves the number to about the end of the parser's first window of 65536 bytes.
      for (const size_t blanks : {size_t{65536} - 400, size_t{65536} - 300})
        EXPECT_EQ(
            triangles_of_file(with("\"extras\":\"" + std::string(blanks, 'x') + "\"," + member))
                .size(),
            1u);
    }
  }
  for (const char* number : {"NaNa", "Inf1", "1.#", "nil", "1.#INFx", "N", "-", "+1"})
    EXPECT_NE(error_of_file(with(std::string("\"max\":[") + number + "]"))
                  .message()
                  .find("JSON is broken"),
              std::string::npos)
        << number;
  EXPECT_EQ(error_of_file(R"({"asset":{"version":"2.0"},"nodes":[{"scale":[1,NaN,1]}]})").message(),
            "folder/scene: nodes[0].scale[1] is null, expected a number");
  EXPECT_EQ(error_of_file(R"({"asset":{"version":"2.0"}} NaN)").message().empty(), false);
}

// NaN is recognized at every position relative to the end of a window.
TEST(GltfNumbers, NotFiniteAcrossWindows) {
  for (size_t shift = 0; shift < 24; ++shift) {
    const std::string begin = R"({"asset":{"version":"2.0"},"extras":")";
    const std::string text = begin + std::string(65536 - begin.size() - shift, 'x') +
                             R"(","extras2":[-Infinity,NaN,-1.#INF]})";
    EXPECT_EQ(error_of_file(text).message(), "") << shift;
  }
}

// Integers can be written with a point or an exponent, like 36.0 and 3.6e1.
TEST(GltfNumbers, WholeNumbersWithPoints) {
  SceneBuilder scene = textured(std::string());
  scene.root["images"] = {{{"bufferView", 0}}};
  std::string json = scene.gltf("data:;base64," + base64(scene.bin));
  const auto expect_same = [&](const std::string& text) {
    OpenScene plain(json), open(text);
    EXPECT_EQ(open.triangles(), plain.triangles());
    EXPECT_EQ(open.source->materials().images.size(), plain.source->materials().images.size());
    EXPECT_EQ(texts_of(open.source->materials().warnings.list()),
              texts_of(plain.source->materials().warnings.list()));
  };
  const auto number_end = [](const std::string& text, size_t at) {
    return std::min(text.find_first_not_of("0123456789", at), text.size());
  };
  for (const char* suffix : {".0", ".000", "e0", ".0E+0"}) {
    std::string text;
    bool in_string = false;
    for (size_t i = 0; i < json.size();) {
      if (json[i] == '"') in_string = !in_string;
      if (in_string || json[i] < '0' || json[i] > '9') {
        text += json[i++];
        continue;
      }
      const size_t end = number_end(json, i);
      text += json.substr(i, end - i) + suffix;
      i = end;
    }
    expect_same(text);
  }
  for (const char* number : {"0.5", "1e300", "-1.0", "3.6e-1", "9007199254740994.0"}) {
    std::string text = json;
    text.replace(text.find("\"count\":3") + 8, 1, number);
    EXPECT_NE(error_of_file(text).message().find(".count is "), std::string::npos) << number;
  }
}

// A file whose header declares more than 1 GiB of JSON is refused before the JSON is read.
TEST(GltfContainer, JsonOfMoreThanTheLimit) {
  class HugeFile : public ReadableFile {
   public:
    const std::string& path() const override { return path_; }
    uint64_t size() const override { return (uint64_t{1} << 30) + 1; }
    void read_at(uint64_t, std::span<std::byte> out) const override {
      std::ranges::fill(out, std::byte{'{'});
    }

   private:
    const std::string path_ = "huge.gltf";
  };
  class HugeFiles : public MemoryFiles {
   public:
    std::unique_ptr<ReadableFile> open_read(const std::string&) override {
      return std::make_unique<HugeFile>();
    }
  };
  HugeFiles files;
  MemoryBudget budget(uint64_t{64} << 20);
  CancelToken cancel;
  try {
    open_scene(files, {"huge.gltf"}, {}, budget, cancel);
    FAIL() << "was opened";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kLimit);
    EXPECT_NE(e.message().find("the limit is 1 GiB"), std::string::npos);
  }
}

// Images are never read, and broken images and materials do not matter to the geometry.
TEST(GltfContainer, ImagesAreNeverRead) {
  SceneBuilder scene = one_triangle();
  scene.root["images"] = {{{"bufferView", 999}, {"mimeType", 7}}, {{"uri", "not there.png"}}};
  scene.root["textures"] = {{{"source", -1}}};
  scene.root["materials"] = {{{"pbrMetallicRoughness", 3}},
                             {{"pbrMetallicRoughness", {{"baseColorFactor", {1}}}}},
                             {{"emissiveFactor", "red"}},
                             7};
  scene.root["samplers"] = Json::object();
  scene.root["meshes"][0]["primitives"][0]["material"] = 77;
  scene.root["nodes"][0]["extras"] = {{"deep", {1, 2, 3}}};
  EXPECT_EQ(triangles_of_file(scene.glb()).size(), 1u);
}

// A mesh is far larger than the budget, and its triangles use vertices from all parts of it. The
// triangles are the same as with a sufficient budget, and the peak never exceeds the limit.
TEST(GltfWindows, LargerThanTheBudget) {
  constexpr uint32_t kVertices = 120000;
  constexpr size_t kTriangles = 20000;
  SCOPED_TRACE("seed 1");
  std::mt19937 random(1);
  std::vector<float> positions(3 * kVertices);
  for (float& p : positions) p = static_cast<float>(random() % 100000);
  std::vector<uint32_t> corners(3 * kTriangles);
  // Each corner is the next vertex or, in one of 50 cases, a random vertex.
  for (size_t i = 0; i < corners.size(); ++i)
    corners[i] = random() % 50 ? static_cast<uint32_t>(i % kVertices) : random() % kVertices;
  SceneBuilder scene;
  const int p = scene.add_positions(positions);
  const int i = scene.add_accessor("SCALAR", kU32, corners);
  scene.add_root({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", p}}}, {"indices", i}})}});
  const std::string file = scene.glb();
  ASSERT_GT(file.size(), size_t{1} << 20);

  OpenScene ample(file);
  OpenScene tight(file, {}, uint64_t{1} << 20);
  const auto expected = ample.triangles();
  ASSERT_EQ(expected.size(), kTriangles);
  for (size_t t = 0; t < kTriangles; ++t)
    for (size_t k = 0; k < 3; ++k)
      ASSERT_EQ(expected[t][k][1], positions[3 * corners[3 * t + k] + 1]);
  EXPECT_EQ(tight.triangles(), expected);
  EXPECT_GT(ample.budget.peak(), tight.budget.limit());
  EXPECT_LE(tight.budget.peak(), tight.budget.limit());
}

// Memory that is charged while streaming is released when the stream ends; all other memory is
// released with the scene.
TEST(GltfWindows, ChargesAreReleased) {
  OpenScene open(one_triangle().glb());
  const uint64_t resting = open.budget.used();
  EXPECT_GT(resting, 0u);
  open.triangles();
  EXPECT_EQ(open.budget.used(), resting);
  open.source.reset();
  EXPECT_EQ(open.budget.used(), 0u);
}

// Returns the message of the error that a scene with this JSON causes under a budget of
// `budget_bytes`. Checks that the budget is not exceeded.
std::string out_of_memory_message(std::string json, uint64_t budget_bytes) {
  MemoryFiles files;
  files.contents["folder/scene"] = std::move(json);
  MemoryBudget budget(budget_bytes);
  CancelToken cancel;
  try {
    triangles_of(*open_scene(files, {"folder/scene"}, {}, budget, cancel));
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kOutOfMemory) << e.message();
    return e.message();
  }
  return "";
}

std::string repeated(const std::string& text, size_t count) {
  std::string all;
  for (size_t i = 0; i < count; ++i) all.append(i ? "," : "").append(text);
  return all;
}

// Every array whose length the file determines is charged. Otherwise JSON of a few megabytes could
// take many times its size in memory without a charge.
TEST(GltfMemory, ArraysAreCharged) {
  const std::pair<const char*, const char*> arrays[] = {
      {"buffers", R"({"byteLength":1})"},
      {"extensionsUsed", R"("a")"},
      {"extensionsRequired", R"("KHR_texture_transform")"},
      {"materials", "{}"},
      {"textures", R"({"extensions":{"a":[1,2,3]}})"},
      {"images", "{}"},
      {"scenes", "{}"},
      {"nodes", "{}"},
      {"skins", R"({"joints":[]})"},
      {"meshes", R"({"primitives":[]})"},
      {"bufferViews", R"({"buffer":0,"byteLength":1})"}};
  for (const auto& [section, element] : arrays) {
    const std::string json = R"({"asset":{"version":"2.0"},")" + std::string(section) + R"(":[)" +
                             repeated(element, 100000) + "]}";
    EXPECT_NE(out_of_memory_message(json, uint64_t{2} << 20), "") << section;
  }
}

// Arrays within one element are also charged while they are read, so a large array exceeds the
// budget.
TEST(GltfMemory, ElementsAreCharged) {
  for (const char* section : {R"("nodes":[{"children":[)", R"("scenes":[{"nodes":[)",
                              R"("skins":[{"joints":[)", R"("meshes":[{"primitives":[)"}) {
    const std::string json =
        R"({"asset":{"version":"2.0"},)" + std::string(section) + repeated("0", 100000) + "]}]}";
    EXPECT_NE(out_of_memory_message(json, uint64_t{2} << 20)
                  .find("an element in the JSON of folder/scene needs over"),
              std::string::npos)
        << section;
  }
}

// The parser collects some data of members that are not read. This memory is charged. A number of
// over 1024 characters is refused. White space takes no memory.
TEST(GltfMemory, WhatTheParserCollectsIsBounded) {
  const std::string rest = R"("asset":{"version":"2.0"}})", blanks(4 << 20, ' ');
  EXPECT_EQ(out_of_memory_message("{" + blanks + rest, uint64_t{2} << 20), "");
  EXPECT_NE(out_of_memory_message(R"({"extras":[)" + repeated("[]", 1 << 20) + "]," + rest,
                                  uint64_t{2} << 20)
                .find("in the JSON of folder/scene needs over"),
            std::string::npos);
  const Error digits = error_of_file(R"({"extras":)" + std::string(1 << 20, '1') + "," + rest);
  EXPECT_NE(digits.message().find("a number of over 1024 characters"), std::string::npos);
}

// Strings in members that are not read take no memory.
TEST(GltfMemory, SkippedStringsAreNotCharged) {
  SceneBuilder scene = one_triangle();
  for (int i = 0; i < 1000; ++i) scene.root["extras"].push_back(std::string(4000, 'x'));
  OpenScene open(scene.glb(), {}, uint64_t{2} << 20);
  EXPECT_EQ(open.triangles().size(), 1u);
}

// A skin with 100,000 joints is refused, because its matrices are charged and exceed the budget.
TEST(GltfMemory, JointMatricesAreCharged) {
  SceneBuilder scene = one_triangle();
  Json& attributes = scene.root["meshes"][0]["primitives"][0]["attributes"];
  attributes["JOINTS_0"] = scene.add_accessor<uint8_t>("VEC4", kU8, std::vector<uint8_t>(12, 0));
  attributes["WEIGHTS_0"] = scene.add_accessor<float>("VEC4", kF32, std::vector<float>(12, 0.25f));
  scene.add("skins", {{"joints", Json::array({0})}});
  scene.root["nodes"][0]["skin"] = 0;
  EXPECT_EQ(OpenScene(scene.glb(), {}, uint64_t{8} << 20).triangles().size(), 1u);
  scene.root["skins"][0]["joints"] = std::vector<int>(100000, 0);
  OpenScene open(scene.glb(), {}, uint64_t{8} << 20);
  try {
    open.triangles();
    FAIL() << "9.6 MB of matrices fit 8 MiB";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kOutOfMemory);
    EXPECT_NE(e.message().find("folder/scene: skin 0 needs"), std::string::npos) << e.message();
  }
}

// tinygltf parses a text with the materials only, which the reader writes from its JSON parser's
// events. The text omits extras, and preserves escaped strings and several elements per section.
TEST(GltfModel, TextOfMaterialsIsFiltered) {
  SceneBuilder scene = one_triangle();
  const std::string name = "a \"quoted\" \\ name\n\u00e9";
  scene.root["materials"] = {
      {{"extras", {{"name", "wrong"}}}, {"name", name}},
      {{"extensions", {{"X", {{"list", {1, -2.5, true, {{"deep", "x"}}}}}}}}, {"name", "second"}}};
  scene.root["samplers"] = nlohmann::json::array();
  MemoryFiles files;
  files.contents["scene"] = scene.glb();
  MemoryBudget budget(uint64_t{1} << 20);
  const gltf::Document document =
      gltf::read_document(*files.open_read("scene"), {}, budget, CancelToken());
  const auto& materials = document.model->materials;

  ASSERT_EQ(materials.size(), 2u);
  EXPECT_EQ(materials[0].name, name);
  EXPECT_FALSE(materials[0].extras.Has("name"));
  EXPECT_EQ(materials[1].name, "second");
  const auto& list = materials[1].extensions.at("X").Get("list");
  ASSERT_EQ(list.ArrayLen(), 4u);
  EXPECT_EQ(list.Get(0).GetNumberAsInt(), 1);
  EXPECT_EQ(list.Get(1).GetNumberAsDouble(), -2.5);
  EXPECT_TRUE(list.Get(2).Get<bool>());
  EXPECT_EQ(list.Get(3).Get("deep").Get<std::string>(), "x");
}

// tinygltf's model contains materials, textures, samplers and images. Images are not loaded; a
// data: URI is replaced by its position in the file.
TEST(GltfModel, HasTheMaterials) {
  SceneBuilder scene = one_triangle();
  const std::string uri = "data:image/png;base64," + std::string(100000, 'A');
  scene.root["images"] = {{{"uri", uri}, {"name", "inside"}},
                          {{"bufferView", 1}, {"mimeType", "image/png"}},
                          {{"uri", "not%20there.png"}}};
  scene.root["samplers"] = {{{"wrapS", 33071}}};
  scene.root["textures"] = {{{"source", 2}, {"sampler", 0}}};
  scene.root["materials"] = {
      {{"name", "red"},
       {"alphaMode", "MASK"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.1, 0.25, 0.5, 1}},
         {"baseColorTexture",
          {{"index", 0},
           {"texCoord", 1},
           {"extensions", {{"KHR_texture_transform", {{"offset", {0.5, 2}}}}}}}}}}}};
  scene.root["extensionsUsed"] = {"KHR_texture_transform"};
  MemoryFiles files;
  const std::string& text = files.contents["scene"] = scene.glb();
  MemoryBudget budget(uint64_t{1} << 20);
  const gltf::Document document =
      gltf::read_document(*files.open_read("scene"), {}, budget, CancelToken());
  const gltf::tinygltf::Model& model = *document.model;

  ASSERT_EQ(model.materials.size(), 1u);
  EXPECT_EQ(model.materials[0].name, "red");
  EXPECT_EQ(model.materials[0].alphaMode, "MASK");
  const auto& pbr = model.materials[0].pbrMetallicRoughness;
  EXPECT_EQ(pbr.baseColorFactor, (std::vector<double>{0.1, 0.25, 0.5, 1}));
  EXPECT_EQ(pbr.baseColorTexture.index, 0);
  EXPECT_EQ(pbr.baseColorTexture.texCoord, 1);
  const auto& transform = pbr.baseColorTexture.extensions.at("KHR_texture_transform");
  EXPECT_EQ(transform.Get("offset").Get(0).GetNumberAsDouble(), 0.5);
  ASSERT_EQ(model.textures.size(), 1u);
  EXPECT_EQ(model.textures[0].source, 2);
  ASSERT_EQ(model.samplers.size(), 1u);
  EXPECT_EQ(model.samplers[0].wrapS, 33071);
  ASSERT_EQ(document.extensions_used.size(), 1u);
  EXPECT_EQ(document.extensions_used[0], "KHR_texture_transform");

  ASSERT_EQ(model.images.size(), 3u);
  EXPECT_EQ(model.images[0].name, "inside");
  EXPECT_EQ(model.images[0].uri, "data:image/png;base64,");
  const gltf::FileRange range = document.image_uris[0].characters;
  EXPECT_EQ(text.substr(range.begin, range.size), uri);
  EXPECT_EQ(model.images[1].bufferView, 1);
  EXPECT_EQ(model.images[1].mimeType, "image/png");
  EXPECT_EQ(model.images[2].uri, "not%20there.png");
  for (const auto& image : model.images) EXPECT_TRUE(image.image.empty());
}

TEST(GltfWindows, TooSmallABudgetIsAnError) {
  try {
    OpenScene(one_triangle().glb(), {}, 1000);
    FAIL() << "was opened";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kOutOfMemory);
  }
}

// Opening and streaming both stop once they are canceled.
TEST(GltfWindows, Canceled) {
  OpenScene open(one_triangle().glb());
  open.cancel.cancel();
  const auto code_of = [](const auto& action) {
    try {
      action();
    } catch (const Error& e) {
      return e.code();
    }
    return ErrorCode::kInvalidInput;
  };
  EXPECT_EQ(code_of([&] { open.triangles(); }), ErrorCode::kCanceled);
  EXPECT_EQ(
      code_of([&] { open_scene(open.files, {"folder/scene"}, {}, open.budget, open.cancel); }),
      ErrorCode::kCanceled);
}

// Batches have 1 to 1024 triangles, collected across nodes.
TEST(GltfWindows, BatchesAreFull) {
  SceneBuilder scene = one_triangle();
  for (int i = 1; i < 5000; ++i) scene.add_root({{"mesh", 0}});
  OpenScene open(scene.glb());
  std::vector<size_t> sizes;
  open.source->for_each_batch(
      [&](std::span<const WorldTriangle> batch) { sizes.push_back(batch.size()); });
  EXPECT_EQ(sizes, (std::vector<size_t>{1024, 1024, 1024, 1024, 904}));
}

}  // namespace
}  // namespace voxdag::test
