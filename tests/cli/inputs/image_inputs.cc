// glTF files with textures: image formats, emitted light and cutouts.
#include "tests/cli/inputs/input.h"
#include "tests/support/image_files.h"
#include "tests/support/modern_image_files.h"

namespace input_files {
namespace {

const std::string kPixel = "\x1e\xa0\x5a\xff";

std::string data_uri(const std::string& image) {
  return "data:application/octet-stream;base64," + voxdag::test::base64(image);
}

// Returns the mesh with the image at `uri` as its base color.
SceneBuilder textured(const std::string& uri) {
  SceneBuilder scene = band_scene();
  scene.root["images"] = {{{"uri", uri}}};
  scene.root["textures"] = {{{"source", 0}}};
  scene.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  Json& primitive = only_primitive(scene);
  primitive["material"] = 0;
  primitive["attributes"]["TEXCOORD_0"] =
      scene.add_accessor("VEC2", voxdag::test::kF32, std::vector<float>(24, 0.5f));
  return scene;
}

// Returns the mesh with an image that its texture names only in this extension, not in `source`.
std::string by_extension(const std::string& extension, const std::string& uri) {
  SceneBuilder scene = textured(uri);
  scene.root["textures"] = {{{"extensions", {{extension, {{"source", 0}}}}}}};
  require_extension(scene, extension);
  return scene.glb();
}

std::string emissive() {
  SceneBuilder scene = textured(data_uri(voxdag::test::png_file({}, kPixel)));
  scene.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0, 1}}}},
                              {"emissiveFactor", {1, 1, 1}},
                              {"emissiveTexture", {{"index", 0}}}}};
  return scene.glb();
}

Input other_technique() {
  SceneBuilder scene = textured("logo.png");
  require_extension(scene, "KHR_technique_webgl");
  Input input{"required extension of materials, with an image",
              scene.glb(),
              {{"logo.png", voxdag::test::png_file({}, kPixel)}}};
  input.color = kGreen;
  input.warning = "harmless-extension";
  return input;
}

WorldTriangles rectangle(double width) {
  const oracle::WorldPoint a{0, 0, 0}, b{width, 0, 0}, c{width, 12, 0}, d{0, 12, 0};
  return {{a, b, c}, {a, c, d}};
}

// Returns a rectangle of 16 x 12. The texels from x = 10 on are transparent, so only a rectangle of
// 10 x 12 is visible.
Input cut_out() {
  SceneBuilder scene;
  const int positions = scene.add_positions({0, 0, 0, 16, 0, 0, 16, 12, 0, 0, 12, 0});
  const int texture =
      scene.add_accessor<float>("VEC2", voxdag::test::kF32, {0, 0, 1, 0, 1, 1, 0, 1});
  const int indices =
      scene.add_accessor<uint16_t>("SCALAR", voxdag::test::kU16, {0, 1, 2, 0, 2, 3});
  scene.add_root(
      {{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", texture}}},
                                {"indices", indices},
                                {"material", 0}})}});
  std::string pixels;
  for (int i = 0; i < 16; ++i) pixels += i < 10 ? kPixel : std::string(4, '\0');
  voxdag::test::PngFormat format;
  format.width = 16;
  scene.root["images"] = {{{"uri", data_uri(voxdag::test::png_file(format, pixels))}}};
  scene.root["textures"] = {{{"source", 0}}};
  scene.root["materials"] = {
      {{"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  return {"cutouts", scene.glb(), {}, rectangle(16), rectangle(10), kGreen};
}

Input unreadable() {
  const std::string image = std::string("\xABKTX 20\xBB\r\n\x1A\n", 12) + std::string(100, '\0');
  Input input{"KTX2", by_extension("KHR_texture_basisu", data_uri(image)), {}};
  input.color = Color{255, 255, 255};
  input.warning = "unusable-image";
  return input;
}

}  // namespace

std::vector<Input> image_inputs() {
  std::vector<Input> all = {{"emitted light", emissive(), {}}};
#ifdef VOXDAG_HAS_WEBP
  const std::string webp = voxdag::test::webp_file(1, 1, kPixel);
  all.push_back({"EXT_texture_webp", by_extension("EXT_texture_webp", data_uri(webp)), {}});
  all.push_back({"WebP without an extension", textured(data_uri(webp)).glb(), {}});
  all.push_back({"WebP in a separate file",
                 by_extension("EXT_texture_webp", "a logo.webp"),
                 {{"a logo.webp", webp}}});
#endif
  for (Input& input : all) input.color = kGreen;
  all.insert(all.end(), {other_technique(), cut_out(), unreadable()});
  return all;
}

}  // namespace input_files
