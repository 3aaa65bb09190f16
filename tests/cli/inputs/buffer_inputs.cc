// glTF files whose buffers have unusual URIs, and files that no command can build: the error names
// the format of the file or the reason.
#include "tests/cli/inputs/input.h"

namespace input_files {
namespace {

const std::string kData = "data:application/octet-stream";
const std::string kPointer =
    "version https://git-lfs.github.com/spec/v1\n"
    "oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n";

std::string percent_encoded(const std::string& bytes) {
  static const char* kDigits = "0123456789ABCDEF";
  std::string text;
  for (const char byte : bytes) {
    const auto value = static_cast<unsigned char>(byte);
    text += {'%', kDigits[value / 16], kDigits[value % 16]};
  }
  return text;
}

std::string with_line_breaks(const std::string& text) {
  std::string lines;
  for (size_t i = 0; i < text.size(); i += 40) lines += text.substr(i, 40) + "\r\n";
  return lines;
}

Input other_scene_empty() {
  SceneBuilder scene = band_scene();
  scene.root["scenes"].push_back({{"name", "empty"}});
  scene.root["scene"] = 1;
  Input input{"empty default scene", scene.glb(), {}};
  input.error = "scene: scene 1: has no nodes with meshes; they are in other scenes";
  return input;
}

}  // namespace

std::vector<Input> buffer_inputs() {
  const SceneBuilder scene = band_scene();
  const std::string bin = scene.bin;
  return {
      {"uri with a query", scene.gltf("mesh.bin?v=3"), {{"mesh.bin", bin}}},
      {"uri with a backslash", scene.gltf("sub\\mesh.bin"), {{"sub/mesh.bin", bin}}},
      {"uri with a percent sign", scene.gltf("mesh 10%.bin"), {{"mesh 10%.bin", bin}}},
      {"base64 with line ends",
       scene.gltf(kData + ";base64," + with_line_breaks(voxdag::test::base64(bin))),
       {}},
      {"percent-encoded data", scene.gltf(kData + "," + percent_encoded(bin)), {}},
  };
}

std::vector<Input> refused_inputs() {
  std::vector<Input> all = {
      {"gzip", std::string("\x1f\x8b\x08\0\0\0\0\0", 8) + "glTF", {}},
      {"Git LFS pointer", kPointer, {}},
      {"Git LFS pointer as a buffer", band_scene().gltf("mesh.bin"), {{"mesh.bin", kPointer}}},
      {"FBX", std::string("Kaydara FBX Binary  \0\x1a\0", 23), {}},
      other_scene_empty(),
  };
  all[0].error =
      "is compressed by gzip: unpack it first; expected a scene: glTF (.glb, .gltf); PLY";
  all[1].error = "is a Git LFS pointer, not the file itself: run git lfs pull";
  all[2].error = "mesh.bin is a Git LFS pointer, not the file itself: run git lfs pull";
  all[3].error = "FBX";
  return all;
}

}  // namespace input_files
