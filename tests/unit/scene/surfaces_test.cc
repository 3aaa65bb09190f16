// Surfaces of small glTF scenes: corners and materials.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Json& only_primitive(SceneBuilder& scene) { return scene.root["meshes"][0]["primitives"][0]; }

TEST(Surfaces, TextureCoordinatesAndColorsOfCorners) {
  SceneBuilder scene = textured("");
  scene.root["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = scene.add_accessor<uint8_t>(
      "VEC3", kU8, {255, 0, 128, 0, 0, 0, 1, 2, 3}, {{"normalized", true}});
  OpenScene open(scene.glb());
  const auto all = surfaces_of(*open.source);
  ASSERT_EQ(all.size(), 1u);
  constexpr int64_t kOne = int64_t{1} << kTextureBits;
  EXPECT_EQ(all[0].corners[1].texture, (std::array<int64_t, 2>{kOne, 0}));
  EXPECT_EQ(all[0].corners[2].texture, (std::array<int64_t, 2>{kOne / 2, -2 * kOne}));
  EXPECT_EQ(all[0].corners[0].color, (std::array<uint16_t, 4>{65535, 0, 128 * 257, 65535}));
  EXPECT_EQ(all[0].corners[2].color, (std::array<uint16_t, 4>{257, 514, 771, 65535}));
  EXPECT_EQ(all[0].position.v[1][0], 1);
}

// The front of a triangle is the side on which its corners are counterclockwise. For every second
// triangle of a strip, and for triangles of a mirrored node, the front is the other side. If both
// apply, the front is the counterclockwise side again.
TEST(Surfaces, FlippedInStripsAndMirrors) {
  const auto flips_of = [](int mode, Json node) {
    SceneBuilder scene = one_triangle();
    only_primitive(scene) = {{"attributes",
                              {{"POSITION", scene.add_positions({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0,
                                                                 0, 2, 0, 1, 2, 0})}}},
                             {"mode", mode}};
    scene.root["nodes"][0].update(node);
    OpenScene open(scene.glb());
    std::vector<bool> flips;
    for (const SurfaceTriangle& triangle : surfaces_of(*open.source))
      flips.push_back(triangle.is_flipped);
    return flips;
  };
  const std::vector<bool> none(4, false), second{false, true, false, true};
  const std::vector<bool> first{true, false, true, false}, all(4, true);
  const Json mirror = {{"scale", {1, -2, 1}}}, turned = {{"scale", {-1, -1, 1}}};
  EXPECT_EQ(flips_of(5, {{"translation", {1, 2, 3}}}), second);
  EXPECT_EQ(flips_of(5, mirror), first);
  EXPECT_EQ(flips_of(5, turned), second);
  EXPECT_EQ(flips_of(6, mirror), all);
  EXPECT_EQ(flips_of(6, turned), none);
  EXPECT_EQ(flips_of(4, mirror), std::vector<bool>(2, true));
}

// The transform in the example of the extension selects the lower left quarter of the image.
TEST(Surfaces, TextureTransform) {
  SceneBuilder scene = textured("");
  scene.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = {
      {"KHR_texture_transform",
       {{"offset", {0, 1}}, {"rotation", 1.57079632679}, {"scale", {0.5, 0.5}}}}};
  OpenScene open(scene.glb());
  const auto corner = surfaces_of(*open.source).at(0).corners[1].texture;  // of the corner (1, 0)
  EXPECT_NEAR(std::ldexp(static_cast<double>(corner[0]), -kTextureBits), 0, 1e-6);
  EXPECT_NEAR(std::ldexp(static_cast<double>(corner[1]), -kTextureBits), 0.5, 1e-6);
}

constexpr int64_t kOneImage = int64_t{1} << kTextureBits;
using Channels = std::array<uint16_t, 4>;

SurfaceTriangle with_colors(SceneBuilder scene, int accessor) {
  only_primitive(scene)["attributes"]["COLOR_0"] = accessor;
  OpenScene open(scene.glb());
  EXPECT_TRUE(open.source->materials().warnings.list().empty());
  return surfaces_of(*open.source).at(0);
}

TEST(Surfaces, ColorsOfEveryComponentType) {
  const Json normalized = {{"normalized", true}};
  SceneBuilder scene = one_triangle();
  const auto bytes =
      scene.add_accessor<uint8_t>("VEC4", kU8, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 255}, normalized);
  const auto shorts =
      scene.add_accessor<uint16_t>("VEC3", kU16, {0, 1, 65535, 3, 4, 5, 6, 7, 300}, normalized);
  const auto wide = scene.add_accessor<uint16_t>(
      "VEC4", kU16, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 40000}, normalized);
  const auto reals =
      scene.add_accessor<float>("VEC3", kF32, {0, 1, 0.5, -1, 2, NAN, 0.25, 0, INFINITY});
  const auto transparent =
      scene.add_accessor<float>("VEC4", kF32, {0, 1, 0.5, 0.25, 0, 0, 0, 0, 1, 1, 1, 1});
  EXPECT_EQ(with_colors(scene, bytes).corners[1].color,
            (Channels{4 * 257, 5 * 257, 6 * 257, 7 * 257}));
  EXPECT_EQ(with_colors(scene, bytes).corners[2].color[3], 65535);
  EXPECT_EQ(with_colors(scene, shorts).corners[0].color, (Channels{0, 1, 65535, 65535}));
  EXPECT_EQ(with_colors(scene, shorts).corners[2].color, (Channels{6, 7, 300, 65535}));
  EXPECT_EQ(with_colors(scene, wide).corners[2].color, (Channels{8, 9, 10, 40000}));
  EXPECT_EQ(with_colors(scene, reals).corners[0].color, (Channels{0, 65535, 32768, 65535}));
  EXPECT_EQ(with_colors(scene, reals).corners[1].color, (Channels{0, 65535, 0, 65535}));
  EXPECT_EQ(with_colors(scene, reals).corners[2].color, (Channels{16384, 0, 65535, 65535}));
  EXPECT_EQ(with_colors(scene, transparent).corners[0].color, (Channels{0, 65535, 32768, 16384}));
}

// Colors that cannot be read are omitted with a warning. The geometry is the same.
TEST(Surfaces, BrokenColorsAreLeftOut) {
  SceneBuilder scene = one_triangle();
  const int too_few = scene.add_accessor<float>("VEC3", kF32, {0, 1, 0.5});
  const int pairs = scene.add_accessor<float>("VEC2", kF32, {0, 1, 0.5, 0, 0, 0});
  for (const int accessor : {too_few, pairs, 999}) {
    only_primitive(scene)["attributes"]["COLOR_0"] = accessor;
    OpenScene open(scene.glb());
    ASSERT_EQ(open.source->materials().warnings.list().size(), 1u);
    EXPECT_THAT(open.source->materials().warnings.list()[0].text(), HasSubstr("COLOR_0"));
    EXPECT_EQ(surfaces_of(*open.source).at(0).corners[0].color,
              Channels({65535, 65535, 65535, 65535}));
    EXPECT_EQ(open.triangles().size(), 1u);
  }
}

TEST(Surfaces, TextureCoordinatesOfOtherTypesAndSets) {
  SceneBuilder scene = textured("");
  Json& attributes = only_primitive(scene)["attributes"];
  attributes["TEXCOORD_1"] =
      scene.add_accessor<uint8_t>("VEC2", kU8, {0, 0, 255, 0, 0, 51}, {{"normalized", true}});
  attributes["TEXCOORD_2"] = scene.add_accessor<uint16_t>("VEC2", kU16, {0, 0, 0, 65535, 13107, 0},
                                                          {{"normalized", true}});
  Json& use = scene.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
  const auto corner = [&](size_t k) {
    OpenScene open(scene.glb());
    return surfaces_of(*open.source).at(0).corners[k].texture;
  };
  use["texCoord"] = 1;
  EXPECT_EQ(corner(1), (std::array<int64_t, 2>{kOneImage, 0}));
  EXPECT_EQ(corner(2), (std::array<int64_t, 2>{0, (kOneImage + 2) / 5}));
  // The extension KHR_texture_transform names another set of texture coordinates.
  use["extensions"] = {{"KHR_texture_transform", {{"texCoord", 2}, {"offset", {0, 0.5}}}}};
  EXPECT_EQ(corner(1), (std::array<int64_t, 2>{0, kOneImage / 2 * 3}));
  EXPECT_EQ(corner(2), (std::array<int64_t, 2>{(kOneImage + 2) / 5, kOneImage / 2}));
  // If the primitive lacks the set that the extension names, the material keeps only its factor.
  use["extensions"] = {{"KHR_texture_transform", {{"texCoord", 3}}}};
  OpenScene open(scene.glb());
  const SceneMaterials scene_materials = open.source->materials();
  ASSERT_EQ(scene_materials.warnings.list().size(), 1u);
  EXPECT_THAT(scene_materials.warnings.list()[0].text(), HasSubstr("TEXCOORD_3"));
  const uint32_t material = surfaces_of(*open.source).at(0).material;
  ASSERT_LT(material, scene_materials.materials.size());
  EXPECT_EQ(scene_materials.materials[material].image, Material::kNoImage);
}

std::vector<Material> materials_of(const SceneBuilder& scene) {
  return OpenScene(scene.glb()).source->materials().materials;
}

TEST(Materials, FactorsAndAlphaModes) {
  SceneBuilder scene = one_triangle();
  scene.root["materials"] = {
      {{"name", "a"}, {"pbrMetallicRoughness", {{"baseColorFactor", {0.5, 0, 1, 0.25}}}}},
      {{"name", "b"}, {"alphaMode", "MASK"}, {"alphaCutoff", 0.25}},
      {{"name", "c"}, {"alphaMode", "MASK"}},
      {{"name", "d"}, {"alphaMode", "BLEND"}},
      {{"name", "e"},
       {"extensions",
        {{"KHR_materials_pbrSpecularGlossiness", {{"diffuseFactor", {0, 0.5, 1, 1}}}}}}}};
  only_primitive(scene)["material"] = 1;
  const auto all = materials_of(scene);
  ASSERT_EQ(all.size(), 5u);
  EXPECT_EQ(all[0].factor, (Channels{32768, 0, 65535, 16384}));
  EXPECT_EQ(all[0].alpha_mode, AlphaMode::kOpaque);
  EXPECT_EQ(all[1].alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(all[1].alpha_cutoff, 16384);
  EXPECT_EQ(all[2].alpha_cutoff, 32768);
  EXPECT_EQ(all[3].alpha_mode, AlphaMode::kBlend);
  EXPECT_EQ(all[4].factor, (Channels{0, 32768, 65535, 65535}));
  OpenScene open(scene.glb());
  EXPECT_EQ(surfaces_of(*open.source).at(0).material, 1u);
}

// No alpha reaches a cutoff above 1, so such a material is hidden whatever its texture.
TEST(Materials, CutoffsAboveOne) {
  SceneBuilder scene = one_triangle();
  for (const double cutoff : {1.0, 1.0000001, 2.0, 1e9})
    scene.root["materials"].push_back({{"alphaMode", "MASK"}, {"alphaCutoff", cutoff}});
  const auto all = materials_of(scene);
  ASSERT_GE(all.size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(all[i].alpha_cutoff, 65535);
    EXPECT_EQ(all[i].factor[3], i == 0 ? 65535 : 0);
  }
}

// Members of the first material of textured(), and the expected material. `vertex_red` is the
// expected red of a corner whose vertex color is half red.
struct EmissiveCase {
  Json members;
  std::array<uint16_t, 4> factor;
  bool has_image;
  uint16_t vertex_red;
};

// A material with a black base color has the color of the light that it emits. Vertex colors do not
// change this light.
TEST(Materials, EmittedLight) {
  const Json black = {{"baseColorFactor", {0, 0, 0, 0.5}}};
  const Json black_texture = {{"baseColorFactor", {0, 0, 0, 1}},
                              {"baseColorTexture", {{"index", 0}}}};
  const Json light = {1, 0, 0.5};
  const std::array<uint16_t, 4> emitted{65535, 0, 32768, 65535}, half{65535, 0, 32768, 32768};
  const Json strong = {{"KHR_materials_emissive_strength", {{"emissiveStrength", 4}}}};
  const Json image = {{"index", 0}};
  const EmissiveCase kCases[] = {
      {{{"pbrMetallicRoughness", black}, {"emissiveFactor", light}}, half, false, 65535},
      {{{"pbrMetallicRoughness", black_texture}, {"emissiveFactor", light}}, emitted, false, 65535},
      {{{"pbrMetallicRoughness", black}, {"emissiveFactor", light}, {"emissiveTexture", image}},
       half,
       true,
       65535},
      {{{"pbrMetallicRoughness", black},
        {"emissiveFactor", {0.5, 0, 0.125}},
        {"extensions", strong}},
       half,
       false,
       65535},
      {{{"extensions",
         {{"KHR_materials_pbrSpecularGlossiness", {{"diffuseFactor", {0, 0, 0, 0.5}}}}}},
        {"emissiveFactor", light}},
       half,
       false,
       65535},
      // In the mode MASK, alpha comes from the base color texture. So a material with such a
      // texture shows the emitted light only if the light has the same texture (the next case).
      {{{"pbrMetallicRoughness", black_texture}, {"emissiveFactor", light}, {"alphaMode", "MASK"}},
       {0, 0, 0, 65535},
       true,
       32896},
      {{{"pbrMetallicRoughness", black_texture},
        {"emissiveFactor", light},
        {"emissiveTexture", image},
        {"alphaMode", "MASK"}},
       emitted,
       true,
       65535},
      {{{"pbrMetallicRoughness", black},
        {"emissiveFactor", light},
        {"extensions", {{"KHR_materials_unlit", Json::object()}}}},
       {0, 0, 0, 32768},
       false,
       32896},
      {{{"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0.5, 1}}}}, {"emissiveFactor", light}},
       {0, 0, 32768, 65535},
       false,
       32896},
      {{{"pbrMetallicRoughness", black}, {"emissiveTexture", image}},
       {0, 0, 0, 32768},
       false,
       32896},
  };
  for (const EmissiveCase& expected : kCases) {
    SceneBuilder scene = textured("");
    scene.root["materials"][0] = expected.members;
    only_primitive(scene)["attributes"]["COLOR_0"] = scene.add_accessor<uint8_t>(
        "VEC3", kU8, {128, 0, 0, 128, 0, 0, 128, 0, 0}, {{"normalized", true}});
    OpenScene open(scene.glb());
    const SceneMaterials materials = open.source->materials();
    const Material& material = materials.materials[0];
    EXPECT_EQ(material.factor, expected.factor) << expected.members;
    EXPECT_EQ(material.image != Material::kNoImage, expected.has_image) << expected.members;
    EXPECT_EQ(surfaces_of(*open.source)[0].corners[0].color[0], expected.vertex_red)
        << expected.members;
  }
}

// The image of a texture is its `source`, if that image exists. Otherwise it is an image that an
// extension names, if possible in a format that voxdag can decode.
TEST(Materials, ImagesOfExtensions) {
  const auto image_of = [](const Json& texture) {
    SceneBuilder scene = textured("");
    scene.root["images"] = {{{"uri", "0"}}, {{"uri", "1"}}, {{"uri", "2"}}};
    scene.root["textures"][0] = texture;
    OpenScene open(scene.glb());
    const SceneMaterials materials = open.source->materials();
    return materials.images.empty() ? "" : materials.images[0].name;
  };
  const Json webp = {{"EXT_texture_webp", {{"source", 1}}}},
             avif = {{"EXT_texture_avif", {{"source", 2}}}};
  const Json ktx = {{"KHR_texture_basisu", {{"source", 0}}}};
  Json both = ktx;
  both.update(avif);
  EXPECT_THAT(image_of({{"source", 0}, {"extensions", webp}}), HasSubstr("image 0"));
  EXPECT_THAT(image_of({{"source", 7}, {"extensions", webp}}), HasSubstr("image 1"));
  EXPECT_THAT(image_of({{"extensions", webp}}), HasSubstr("image 1"));
  EXPECT_THAT(image_of({{"extensions", avif}}), HasSubstr("image 2"));
  EXPECT_THAT(image_of({{"extensions", ktx}}), HasSubstr("image 0"));
  EXPECT_THAT(image_of({{"extensions", both}}), HasSubstr("image 2"));
  EXPECT_EQ(image_of({{"extensions", Json::object()}}), "");
}

TEST(Materials, WrapModes) {
  SceneBuilder scene = textured("");
  EXPECT_EQ(materials_of(scene).at(0).wrap, (std::array{Wrap::kRepeat, Wrap::kRepeat}));
  scene.root["textures"][0]["sampler"] = 0;
  scene.root["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}}};
  EXPECT_EQ(materials_of(scene).at(0).wrap,
            (std::array{Wrap::kClampToEdge, Wrap::kMirroredRepeat}));
  scene.root["samplers"] = {{{"wrapS", 10497}, {"wrapT", 33071}}};
  EXPECT_EQ(materials_of(scene).at(0).wrap, (std::array{Wrap::kRepeat, Wrap::kClampToEdge}));
}

TEST(Materials, DiffuseTextureOfSpecularGlossiness) {
  SceneBuilder scene = textured("");
  const Json transform = {{"KHR_texture_transform", {{"scale", {2, 2}}}}};
  scene.root["materials"] = {
      {{"extensions",
        {{"KHR_materials_pbrSpecularGlossiness",
          {{"diffuseTexture", {{"index", 0}, {"extensions", transform}}}}}}}}};
  OpenScene open(scene.glb());
  const SceneMaterials scene_materials = open.source->materials();
  EXPECT_EQ(scene_materials.materials.at(0).image, 0u);
  ASSERT_EQ(scene_materials.images.size(), 1u);
  EXPECT_THAT(scene_materials.images[0].name, HasSubstr("image 0 \"wood\""));
  EXPECT_EQ(surfaces_of(*open.source).at(0).corners[1].texture[0], 2 * kOneImage);
}

// Materials and images are listed in the order of the files.
TEST(Materials, OfSeveralFiles) {
  MemoryFiles files;
  SceneBuilder plain = one_triangle();
  plain.root["materials"] = {{{"name", "first"}}, {{"name", "second"}}};
  only_primitive(plain)["material"] = 1;
  files.contents["plain"] = plain.glb();
  files.contents["textured"] = textured("").glb();
  MemoryBudget budget(uint64_t{64} << 20);
  CancelToken cancel;
  const auto scene = open_scene(files, {"textured", "plain", "textured"}, {}, budget, cancel);
  const SceneMaterials scene_materials = scene->materials();
  ASSERT_EQ(scene_materials.materials.size(), scene->material_count());
  ASSERT_EQ(scene_materials.images.size(), 2u);
  const auto triangles = surfaces_of(*scene);
  ASSERT_EQ(triangles.size(), 3u);
  const auto material = [&](size_t i) {
    return scene_materials.materials.at(triangles[i].material);
  };
  EXPECT_EQ(material(0).name, "floor");
  EXPECT_EQ(material(0).image, 0u);
  EXPECT_EQ(material(1).name, "second");
  EXPECT_EQ(material(1).image, Material::kNoImage);
  EXPECT_EQ(material(2).name, "floor");
  EXPECT_EQ(material(2).image, 1u);
  EXPECT_THAT(scene_materials.images[1].name, HasSubstr("textured"));
  // Materials are numbered as the files list them, whether triangles have them or not.
  EXPECT_EQ(scene_materials.names, (std::vector<std::string>{"floor", "first", "second", "floor"}));
  EXPECT_EQ(material(0).number, 0u);
  EXPECT_EQ(material(1).number, 2u);
  EXPECT_EQ(material(2).number, 3u);
}

// A triangle without a material has the number after the last material. A triangle without texture
// coordinates uses a copy of its material without the image. This copy has the material's number.
TEST(Materials, NumbersOfThoseThatAreNotListed) {
  SceneBuilder scene = textured("");
  const Json primitive = only_primitive(scene);
  scene.root["meshes"][0]["primitives"] = {primitive, primitive, primitive};
  scene.root["meshes"][0]["primitives"][1].erase("material");
  scene.root["meshes"][0]["primitives"][2]["attributes"].erase("TEXCOORD_0");
  OpenScene open(scene.glb());
  SceneMaterials scene_materials = open.source->materials();
  EXPECT_EQ(scene_materials.names, std::vector<std::string>{"floor"});
  scene_materials.name_unlisted();
  EXPECT_EQ(scene_materials.names, (std::vector<std::string>{"floor", ""}));
  std::vector<uint32_t> numbers;
  for (const SurfaceTriangle& triangle : surfaces_of(*open.source))
    numbers.push_back(scene_materials.materials.at(triangle.material).number);
  EXPECT_EQ(numbers, (std::vector<uint32_t>{0, 1, 0}));
}

// Each broken member of a material, texture or sampler gives one warning with its place, and counts
// as missing.
TEST(Materials, BrokenMembersAreNamedAndIgnored) {
  const std::pair<Json, const char*> cases[] = {
      {{{"pbrMetallicRoughness", {{"baseColorFactor", {1, 0, 0}}}}},
       "pbrMetallicRoughness.baseColorFactor is an array of 3 numbers, expected an array of four "
       "numbers; it is ignored"},
      {{{"pbrMetallicRoughness", {{"baseColorFactor", {1, 0, "0", 1}}}}},
       "pbrMetallicRoughness.baseColorFactor is an array of 4 values that are not all numbers"},
      {{{"pbrMetallicRoughness", {{"baseColorFactor", 1}}}}, "baseColorFactor is 1, expected"},
      {{{"pbrMetallicRoughness", 3}}, "pbrMetallicRoughness is 3, expected an object"},
      {{{"pbrMetallicRoughness", Json::array()}}, "pbrMetallicRoughness is an array of 0 numbers"},
      {{{"pbrMetallicRoughness", {{"baseColorTexture", 0}}}}, "baseColorTexture is 0, expected an"},
      {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", -1}}}}}},
       "baseColorTexture.index is -1, expected a whole number from 0 to 2147483647"},
      {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"texCoord", 0}}}}}},
       "baseColorTexture.index is missing, but glTF requires it"},
      {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}, {"texCoord", "1"}}}}}},
       "baseColorTexture.texCoord is \"1\", expected"},
      {{{"pbrMetallicRoughness",
         {{"baseColorTexture",
           {{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"scale", 2}}}}}}}}}},
       "KHR_texture_transform.scale is 2, expected an array of two numbers"},
      {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 8}}}}}},
       "its base color texture 8 does not exist"},
      {{{"alphaMode", "FOO"}}, "alphaMode is \"FOO\", expected OPAQUE, MASK or BLEND"},
      {{{"alphaMode", "mask"}}, "alphaMode is \"mask\""},
      {{{"alphaMode", 1}}, "alphaMode is 1"},
      {{{"alphaCutoff", "x"}}, "alphaCutoff is \"x\", expected a number"},
      {{{"alphaCutoff", nullptr}}, "alphaCutoff is null, expected a number"},
      {{{"emissiveFactor", {1, 1}}}, "emissiveFactor is an array of 2 numbers"},
      {{{"emissiveTexture", {{"index", 0.5}}}}, "emissiveTexture.index is 0.5"},
      {{{"extensions", 0}}, "extensions is 0, expected an object"},
      {{{"extensions", {{"KHR_materials_unlit", true}}}}, "KHR_materials_unlit is true"},
      {{{"extensions", {{"KHR_materials_pbrSpecularGlossiness", {{"diffuseFactor", "red"}}}}}},
       "extensions.KHR_materials_pbrSpecularGlossiness.diffuseFactor is \"red\""},
      {{{"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", "1"}}}}}},
       "emissiveStrength is \"1\""},
  };
  for (const auto& [members, message] : cases) {
    SceneBuilder scene = textured("");
    scene.root["materials"][0] = members;
    scene.root["materials"][0]["name"] = "leaf";
    OpenScene open(scene.glb());
    const auto warnings = texts_of(open.source->materials().warnings.list());
    ASSERT_EQ(warnings.size(), 1u) << members;
    EXPECT_THAT(warnings[0],
                AllOf(HasSubstr("folder/scene: material 0 \"leaf\": "), HasSubstr(message)));
    const Material material = open.source->materials().materials[0];
    EXPECT_EQ(material.factor, (Channels{65535, 65535, 65535, 65535})) << members;
    EXPECT_EQ(material.alpha_mode, AlphaMode::kOpaque);
    EXPECT_TRUE(open.source->warnings().empty());
  }
}

TEST(Materials, BrokenTexturesSamplersAndIndices) {
  const auto warnings_of = [](const auto& change) {
    SceneBuilder scene = textured("");
    change(scene.root);
    OpenScene open(scene.glb());
    EXPECT_EQ(open.triangles().size(), 1u);
    return texts_of(open.source->materials().warnings.list());
  };
  EXPECT_THAT(warnings_of([](Json& root) {
                root["textures"][0] = {{"sampler", -1}, {"source", 0}};
              }),
              ElementsAre(HasSubstr("folder/scene: texture 0: sampler is -1, expected a whole")));
  EXPECT_THAT(warnings_of([](Json& root) { root["textures"][0]["sampler"] = 5; }),
              ElementsAre(HasSubstr("base color texture 0 has sampler 5, which does not exist")));
  EXPECT_THAT(warnings_of([](Json& root) {
                root["samplers"] = {{{"wrapS", 1}}};
              }),
              ElementsAre(HasSubstr("sampler 0: wrapS is 1, expected 33071, 33648 or 10497")));
  EXPECT_THAT(warnings_of([](Json& root) { root["samplers"] = {7}; }),
              ElementsAre(HasSubstr("sampler 0: is 7, expected an object")));
  EXPECT_THAT(warnings_of([](Json& root) { root["samplers"] = Json::object(); }),
              ElementsAre(HasSubstr("samplers is an object, expected an array; it is ignored")));
  EXPECT_THAT(warnings_of([](Json& root) { root["textures"][0]["source"] = "wood"; }),
              ElementsAre(HasSubstr("source is \"wood\""), HasSubstr("texture 0 has no image")));
  for (const Json& index : {Json(-1), Json("leaf"), Json(0.5)})
    EXPECT_THAT(
        warnings_of([&](Json& root) { root["meshes"][0]["primitives"][0]["material"] = index; }),
        ElementsAre(HasSubstr("mesh 0: primitive 0: its material is not a whole number")));
}

}  // namespace
}  // namespace voxdag::test
