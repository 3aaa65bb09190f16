// Files that break the rules of glTF 2.0 are refused with an error that names the node, mesh,
// primitive or accessor.
#include <gtest/gtest.h>

#include <cctype>
#include <limits>

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

// A change that makes a valid scene invalid, and words that the error must contain.
struct Refusal {
  const char* what;
  const char* pointer;  // JSON pointer of the replaced or added value
  Json value;
  const char* words;
  ErrorCode code = ErrorCode::kInvalidInput;
};

void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.what; }

const Refusal kRefusals[] = {
    {"glTF 1.0", "/asset/version", "1.0", "glTF version 1.0"},
    {"a later minimum", "/asset/minVersion", "2.1", "needs glTF version 2.1"},
    {"no asset", "/asset", nullptr, "asset is null, expected an object"},
    {"an unknown required extension", "/extensionsRequired", {"ACME_bent"}, "ACME_bent"},
    {"nodes that are no array", "/nodes", Json::object(), "nodes is an object, expected an array"},
    {"a node that is its own child", "/nodes/0/children", {0}, "node 0 \"it\" is its own ancestor"},
    {"a child that is not there", "/nodes/0/children", {7}, "node 0 \"it\": child node 7"},
    {"a negative child", "/nodes/0/children", {-1}, "nodes[0].children[0] is -1"},
    {"a scene node that is not there", "/scenes/0/nodes", {0, 2}, "scene 0: node 2 does not exist"},
    {"a default scene that is not there", "/scene", 3, "scene 3 does not exist"},
    {"a mesh that is not there", "/nodes/0/mesh", 4, "node 0 \"it\": mesh 4 does not exist"},
    {"a negative mesh", "/nodes/0/mesh", -3, "nodes[0].mesh is -3"},
    {"a fractional mesh", "/nodes/0/mesh", 0.5, "nodes[0].mesh is 0.5"},
    {"a huge mesh index", "/nodes/0/mesh", 4294967296, "nodes[0].mesh is 4294967296"},
    {"a skin that is not there", "/nodes/0/skin", 0, "node 0 \"it\": skin 0 does not exist"},
    {"a matrix of 15 numbers",
     "/nodes/0/matrix",
     {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0},
     "node 0 \"it\": its matrix has 15 numbers"},
    {"a projective matrix",
     "/nodes/0/matrix",
     {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},
     "node 0 \"it\": its matrix is not affine"},
    {"a string in a matrix", "/nodes/0/scale", {1, "1", 1}, "nodes[0].scale[1] is a string"},
    {"an infinite scale",
     "/nodes/0",
     {{"mesh", 0}, {"scale", {1, 1, 1e308}}, {"rotation", {100, 0, 0, 1e300}}},
     "node 0: its transform is not finite"},
    {"a position that overflows",
     "/nodes/0/matrix",
     {1.7e308, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1.7e308, 0, 0, 1},
     "node 0 \"it\": mesh 0: primitive 0: triangle 0: a vertex of accessor 0 is not a finite"},
    {"no primitives", "/meshes/0", Json::object(), "meshes[0].primitives is missing"},
    {"no attributes",
     "/meshes/0/primitives/0",
     {{"indices", 1}},
     "primitives[0].attributes is miss"},
    {"a mode that is not there", "/meshes/0/primitives/0/mode", 7,
     "mesh 0: primitive 0 has mode 7"},
    {"POSITION that is not there", "/meshes/0/primitives/0/attributes/POSITION", 9,
     "mesh 0: primitive 0: POSITION: accessor 9 does not exist"},
    {"indices that are not there", "/meshes/0/primitives/0/indices", 9,
     "mesh 0: primitive 0: indices: accessor 9 does not exist"},
    {"POSITION of scalars", "/meshes/0/primitives/0/attributes/POSITION", 1,
     "POSITION: accessor 1 has 1 components, expected 3"},
    {"POSITION of wide integers", "/accessors/0/componentType", kU32,
     "accessor 0 has components of type unsigned int, expected float"},
    {"normalized floats", "/accessors/0/normalized", true, "accessor 0 has normalized"},
    {"indices of floats", "/accessors/1/componentType", kF32,
     "indices: accessor 1 has components of type float"},
    {"indices of signed integers", "/accessors/1/componentType", kI16, "of type short"},
    {"an unknown component type", "/accessors/0/componentType", 5124,
     "accessors[0].componentType is 5124"},
    {"an unknown type", "/accessors/0/type", "VEC9", "accessors[0].type is VEC9"},
    {"morph targets of another count", "/meshes/0/primitives/0/targets",
     Json::array({{{"POSITION", 2}}}), "accessor 2 has 2 elements, expected 3"},
    {"a target that is not there", "/meshes/0/primitives/0/targets",
     Json::array({{{"POSITION", 8}}}), "morph target: accessor 8 does not exist"},
    {"joints without weights", "/meshes/0/primitives/0/attributes/JOINTS_0", 0, "JOINTS_0 without"},
    {"more elements than bytes", "/accessors/0/count", 4,
     "POSITION: accessor 0: bufferView 0 has 36 bytes, expected at least 48"},
    {"2^40 elements", "/accessors/0/count", uint64_t{1} << 40, "the limit is 2^32",
     ErrorCode::kLimit},
    {"2^32 elements", "/accessors/0/count", uint64_t{1} << 32, "has 36 bytes, expected at least"},
    {"an offset that overflows", "/accessors/0/byteOffset", INT64_MAX,
     "has 36 bytes, expected at least"},
    {"an offset past the view", "/accessors/0/byteOffset", 4, "has 36 bytes, expected at least"},
    {"a negative offset", "/accessors/0/byteOffset", -4, "accessors[0].byteOffset is -4"},
    {"a count of text", "/accessors/0/count", "3", "accessors[0].count is a string"},
    {"a view that is not there", "/accessors/0/bufferView", 5, "bufferView 5 does not exist"},
    {"a stride below the element", "/bufferViews/0/byteStride", 8,
     "the byteStride of bufferView 0"},
    {"a stride beyond the view", "/bufferViews/0/byteStride", 252,
     "has 36 bytes, expected at least"},
    {"a stride over 252", "/bufferViews/0/byteStride", 256, "has 36 bytes, expected at least"},
    {"a stride of 2^62", "/bufferViews/0/byteStride", int64_t{1} << 62,
     "has 36 bytes, expected at least"},
    {"an odd stride beyond the view", "/bufferViews/0/byteStride", 13,
     "has 36 bytes, expected at least"},
    {"a negative stride", "/bufferViews/0/byteStride", -12, "bufferViews[0].byteStride is -12"},
    {"indices with a stride beyond the view", "/bufferViews/1/byteStride", 4,
     "has 6 bytes, expected at least 10"},
    {"a view past its buffer", "/bufferViews/0/byteLength", 4096, "bytes, expected at least"},
    {"a view that overflows", "/bufferViews/0/byteOffset", INT64_MAX, "bytes, expected at least"},
    {"a fractional view", "/bufferViews/0/byteLength", 1e300, "bufferViews[0].byteLength is 1e"},
    {"a buffer that is not there", "/bufferViews/0/buffer", 2, "buffer 2 does not exist"},
    {"more sparse elements than elements", "/accessors/0/sparse/count", 4,
     "has 4 sparse replacements, expected at most 3"},
    {"sparse values past their view", "/accessors/0/sparse/values/byteOffset", 4,
     "its sparse values: bufferView"},
    {"signed sparse indices", "/accessors/0/sparse/indices/componentType", kI8,
     "its sparse indices are not unsigned integers"},
    {"instances of another count",
     "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes",
     {{"TRANSLATION", 0}, {"SCALE", 2}},
     "EXT_mesh_gpu_instancing: accessor"},
    {"instances of a wrong type",
     "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes",
     {{"ROTATION", 0}},
     "ROTATION: accessor 0 has 3 components, expected 4"},
};

// Returns a scene with one triangle from a sparse accessor, a second unused node, and an accessor
// of two vectors.
SceneBuilder valid_scene() {
  SceneBuilder scene = one_triangle();
  scene.root["nodes"][0]["name"] = "it";
  scene.add("nodes", Json::object());
  scene.add_positions({0, 0, 0, 1, 1, 1});
  scene.root["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", scene.add_view<uint8_t>({2})}, {"componentType", kU8}}},
      {"values", {{"bufferView", scene.add_view<float>({0, 1, 0})}}}};
  scene.root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", 0}, {"attributes", {{"POSITION", 0}}}};
  return scene;
}

TEST(GltfRefusals, TheSceneIsValidBeforeItIsBroken) {
  EXPECT_EQ(triangles_of_file(valid_scene().glb()).size(), 1u);
}

class GltfRefusal : public testing::TestWithParam<Refusal> {};

TEST_P(GltfRefusal, NamesTheOffender) {
  const Refusal& refusal = GetParam();
  SCOPED_TRACE(refusal.what);
  SceneBuilder scene = valid_scene();
  scene.root[Json::json_pointer(refusal.pointer)] = refusal.value;
  const Error error = error_of_file(scene.glb());
  EXPECT_EQ(error.code(), refusal.code);
  EXPECT_NE(error.message().find(refusal.words), std::string::npos) << error.message();
  EXPECT_EQ(error.message().find("folder/scene: "), 0u) << error.message();
}

std::string test_name(const testing::TestParamInfo<Refusal>& info) {
  std::string name = info.param.what;
  std::erase_if(name, [](unsigned char c) { return !std::isalnum(c) && c != ' '; });
  std::ranges::replace(name, ' ', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(All, GltfRefusal, testing::ValuesIn(kRefusals), test_name);

// Control characters in a scene's names must not reach a terminal or a log, where they could send
// commands or forge a line.
TEST(GltfMessages, ControlCharactersOfASceneAreNotShown) {
  const std::string hostile =
      "A\n2026-11-21T00:00:00Z done\x1b[31m\x1b]0;title\x07\xc2\x9b"
      "2J\x7f";
  const std::pair<const char*, Json> places[] = {
      {"/meshes/0/primitives/0/attributes", {{"POSITION", 0}, {hostile, "text"}}},
      {"/meshes/0/primitives/0",
       {{"attributes", {{"POSITION", 0}}}, {hostile, 1}, {"mode", hostile}}},
      {"/nodes/0", {{"name", hostile}, {"mesh", 7}}},
      {"/accessors/0/type", hostile},
      {"/asset/version", hostile},
      {"/extensionsRequired", {hostile}},
      {"/buffers/0/uri", hostile}};
  for (const auto& [pointer, value] : places) {
    SCOPED_TRACE(pointer);
    SceneBuilder scene = valid_scene();
    scene.root[Json::json_pointer(pointer)] = value;
    const std::string message = error_of_file(scene.glb()).message();
    EXPECT_TRUE(std::ranges::none_of(message, [](unsigned char c) {
      return c < 0x20 || c == 0x7f;
    })) << message;
    EXPECT_EQ(message.find("\xc2\x9b"), std::string::npos) << message;
  }
}

// A file that is not JSON is not called broken JSON. No message names a class of the JSON library.
TEST(GltfMessages, GarbageIsNotCalledJson) {
  for (const char* text : {"\xef\x01\x02\x03", "\xef\xbb\xbf garbage", "\xef", "{broken", "[1,",
                           "\xef\xbb\xbf{\"a\":}"}) {
    const std::string message = error_of_file(text).message();
    const bool is_json = std::string(text).find_first_of("{[") != std::string::npos;
    EXPECT_NE(message.find(is_json ? "its JSON is broken" : "has an unknown format"),
              std::string::npos)
        << message;
    EXPECT_EQ(message.find("json.exception"), std::string::npos) << message;
    EXPECT_EQ(message.find("BOM"), std::string::npos) << message;
  }
}

// A drawn node with two parents is refused.
TEST(GltfRefusals, TwoParents) {
  SceneBuilder scene = valid_scene();
  scene.add("nodes", Json::object());
  scene.root["nodes"][0]["children"] = {2};
  scene.root["nodes"][1]["children"] = {2};
  EXPECT_NE(error_of_file(scene.glb()).message().find("node 2 has two parents, node 0 \"it\""),
            std::string::npos);
}

// A cycle of nodes is an error even if it cannot be reached from the scene's roots.
TEST(GltfRefusals, LongCycle) {
  SceneBuilder scene = valid_scene();
  scene.root["nodes"][1]["children"] = {2};
  scene.add("nodes", {{"children", {3}}});
  scene.add("nodes", {{"children", {1}}});
  EXPECT_NE(error_of_file(scene.glb()).message().find("is its own ancestor"), std::string::npos);
}

// Sparse indices must increase and be in range. This is checked when the accessor is read.
TEST(GltfRefusals, SparseIndices) {
  for (const std::vector<uint8_t>& indices :
       {std::vector<uint8_t>{1, 1}, std::vector<uint8_t>{2, 1}, std::vector<uint8_t>{1, 3}}) {
    SceneBuilder scene = valid_scene();
    scene.root["accessors"][0]["sparse"] = {
        {"count", 2},
        {"indices", {{"bufferView", scene.add_view(indices)}, {"componentType", kU8}}},
        {"values", {{"bufferView", scene.add_view<float>({0, 1, 0, 0, 1, 0})}}}};
    EXPECT_NE(error_of_file(scene.glb()).message().find("accessor 0: its sparse index "),
              std::string::npos);
  }
}

// A sparse accessor does not need a base view; its other elements are then 0.
TEST(GltfRefusals, SparseIndicesWithoutBase) {
  SceneBuilder scene = one_triangle();
  scene.root["accessors"][1].erase("bufferView");
  scene.root["accessors"][1]["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", scene.add_view<uint8_t>({1, 2})}, {"componentType", kU8}}},
      {"values", {{"bufferView", scene.add_view<uint16_t>({1, 2})}}}};
  EXPECT_EQ(triangles_of_file(scene.glb()), triangles_of_file(one_triangle().glb()));
}

// JSON without the member "asset", or whose root is not an object, is refused.
TEST(GltfRefusals, NoAsset) {
  EXPECT_NE(error_of_file("{}").message().find("asset is missing"), std::string::npos);
  EXPECT_NE(error_of_file("[]").message().find("the root is an array, expected an object"),
            std::string::npos);
}

// A member that is given twice is ambiguous, so it is refused.
TEST(GltfRefusals, DuplicateMembers) {
  const std::string json = R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0,"mesh":1}]})";
  EXPECT_NE(error_of_file(json).message().find("nodes[0]: the member mesh is given twice"),
            std::string::npos);
}

// A repeated member is also refused if its first value is a number and its second an object.
TEST(GltfMessages, MemberThatIsANumberAndThenAnObjectIsRefused) {
  const std::string json = R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0,"mesh":{"a":1}}]})";
  EXPECT_NE(error_of_file(json).message().find("nodes[0]: the member mesh is given twice"),
            std::string::npos);
}

// JSON that is nested deeper than any stack is skipped in members that are not read, and otherwise
// refused.
TEST(GltfRefusals, DeeplyNestedJson) {
  const std::string deep = std::string(1000000, '[') + std::string(1000000, ']');
  EXPECT_EQ(error_of_file(R"({"asset":{"version":"2.0"},"extras":)" + deep + "}").message(), "");
  EXPECT_NE(error_of_file(R"({"asset":{"version":"2.0"},"nodes":)" + deep + "}")
                .message()
                .find("nodes[0] is an array, expected an object"),
            std::string::npos);
  EXPECT_EQ(
      error_of_file(R"({"asset":{"version":"2.0"},"materials":[{"extensions":)" + deep + "}]}")
          .message(),
      "");
  EXPECT_NE(error_of_file(std::string(1000000, '[')).message(), "");
}

// Names and keys from a file cannot forge lines of a log.
TEST(GltfRefusals, NamesAreMadePrintable) {
  SceneBuilder scene = valid_scene();
  scene.root["nodes"][0]["name"] = "a\nb\"" + std::string(1000, 'x');
  scene.root["nodes"][0]["mesh"] = 4;
  const Error error = error_of_file(scene.glb());
  EXPECT_NE(error.message().find("node 0 \"a?b?x"), std::string::npos) << error.message();
  EXPECT_LT(error.message().size(), 200u);
  const std::string key =
      error_of_file(R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[)"
                    R"({"attributes":{"X\n2026\u001b[31m":"a"}}]}]})")
          .message();
  EXPECT_NE(key.find("attributes.X?2026?[31m is a string"), std::string::npos) << key;
}

// A file may require extensions that move no vertex. An unknown extension that the file uses but
// does not require causes a warning.
TEST(GltfRefusals, ExtensionsThatAreNot) {
  SceneBuilder scene = valid_scene();
  scene.root["extensionsRequired"] = {"KHR_materials_unlit", "KHR_texture_transform"};
  scene.root["extensionsUsed"] = {"KHR_materials_unlit", "ACME_bent"};
  OpenScene open(scene.glb());
  EXPECT_EQ(open.triangles().size(), 1u);
  ASSERT_EQ(open.source->warnings().size(), 1u);
  EXPECT_NE(open.source->warnings()[0].message.find("ACME_bent"), std::string::npos);
}

// Required extensions that do not move vertices cause a warning with their purpose.
TEST(GltfExtensions, HarmlessOnesMayBeRequired) {
  for (const char* name : {"KHR_technique_webgl", "KHR_techniques_webgl", "FB_ngon_encoding",
                           "KHR_materials_clearcoat", "KHR_lights_punctual", "EXT_lights_ies",
                           "KHR_xmp_json_ld", "KHR_audio_emitter", "KHR_animation_pointer"}) {
    SCOPED_TRACE(name);
    SceneBuilder scene = valid_scene();
    scene.root["extensionsRequired"] = scene.root["extensionsUsed"] = {name};
    OpenScene open(scene.glb());
    EXPECT_EQ(open.triangles().size(), 1u);
    const auto warnings = open.source->warnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_EQ(warnings[0].code, "harmless-extension");
    EXPECT_NE(warnings[0].message.find(name + std::string(" is not read: it ")), std::string::npos)
        << warnings[0].message;
  }
}

// An unknown required extension is refused, unless the user asks to ignore it.
TEST(GltfExtensions, RequiredOnesAreIgnoredOnRequest) {
  SceneBuilder scene = valid_scene();
  scene.root["extensionsRequired"] = scene.root["extensionsUsed"] = {"ACME_bent", "ACME_twisted"};
  EXPECT_NE(error_of_file(scene.glb())
                .message()
                .find("requires the extension ACME_bent, which voxdag does not read; "
                      "--ignore-extension reads"),
            std::string::npos);
  EXPECT_THROW(OpenScene(scene.glb(), {.ignored_extensions = {"ACME_bent"}}), Error);
  EXPECT_THROW(OpenScene(scene.glb(), {.ignored_extensions = {"ACME_"}}), Error);
  OpenScene open(scene.glb(), {.ignored_extensions = {"ACME_twisted", "ACME_bent"}});
  EXPECT_EQ(open.triangles().size(), 1u);
  const auto warnings = open.source->warnings();
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_EQ(warnings[0].code, "ignored-extension");
  EXPECT_EQ(warnings[0].message, "the required extension ACME_bent is ignored on request");
}

// An element that breaks a rule is an error only if the drawn geometry uses it.
TEST(GltfUnused, BrokenElementsCauseAWarning) {
  const std::pair<const char*, Json> unused[] = {
      {"accessors", {{"count", -1}, {"componentType", kF32}, {"type", "VEC3"}}},
      {"accessors", {{"count", 3}, {"componentType", 5124}, {"type", "VEC3"}}},
      {"accessors", "text"},
      {"bufferViews", {{"buffer", 0}}},
      {"meshes", {{"primitives", {{{"indices", 0}}}}}},
      {"meshes", Json::object()},
      {"skins", Json::object()},
      {"buffers", {{"byteLength", "long"}}}};
  for (const auto& [section, value] : unused) {
    SCOPED_TRACE(value.dump());
    SceneBuilder scene = valid_scene();
    scene.root["buffers"] = {{{"byteLength", scene.bin.size()}}};
    const int index = scene.add(section, value);
    const std::string file = make_glb(scene.root.dump(), scene.bin);
    OpenScene open(file);
    EXPECT_EQ(open.triangles().size(), 1u);
    const auto warnings = open.source->warnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_EQ(warnings[0].code, "broken-element");
    EXPECT_NE(warnings[0].message.find(section + ("[" + std::to_string(index) + "]")),
              std::string::npos)
        << warnings[0].message;
  }
}

// Meshes and skins that no drawn node uses are not checked.
TEST(GltfUnused, MeshesAndSkinsAreNotChecked) {
  SceneBuilder scene = valid_scene();
  const int mesh = scene.add_mesh({{"attributes", {{"POSITION", 99}}}, {"mode", 17}});
  const int skin = scene.add("skins", {{"joints", {99}}});
  scene.add("nodes", {{"mesh", mesh}, {"skin", skin}, {"children", {99}}});
  scene.add("nodes", {{"mesh", 99}});
  OpenScene open(scene.glb());
  EXPECT_EQ(open.triangles().size(), 1u);
  EXPECT_EQ(surfaces_of(*open.source).size(), 1u);
  EXPECT_TRUE(open.source->warnings().empty());
}

// Invalid triangles end the build, or are dropped and counted with --skip-invalid. Vertices that no
// triangle uses are not checked, so they can have any value.
TEST(GltfRefusals, InvalidTriangles) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  SceneBuilder scene;
  const int positions = scene.add_positions({0, 0, 0, 1, 0, 0, 0, 1, 0, nan, 0, 0, 0, 0, -inf});
  const int indices = scene.add_accessor<uint16_t>(
      "SCALAR", kU16, {0, 1, 2, 0, 1, 3, 0, 1, 65535, 0, 4, 1, 2, 1, 0});
  scene.add_root({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}},
                                           {"indices", indices}})}});
  EXPECT_NE(error_of_file(scene.glb())
                .message()
                .find("node 0: mesh 0: primitive 0: triangle 1: a vertex of accessor 0"),
            std::string::npos);
  OpenScene skipping(scene.glb(), {.skip_invalid = true});
  EXPECT_EQ(skipping.source->declared_triangles(), 5u);
  for (int pass = 0; pass < 2; ++pass) EXPECT_EQ(skipping.triangles().size(), 2u);
  scene.root["accessors"][1]["count"] = 3;
  EXPECT_EQ(triangles_of_file(scene.glb()).size(), 1u);
  scene.root["accessors"][1]["byteOffset"] = 12;
  EXPECT_NE(error_of_file(scene.glb())
                .message()
                .find("triangle 0: index 65535 of accessor 1 does not exist, there are 5 vertices"),
            std::string::npos);
}

}  // namespace
}  // namespace voxdag::test
