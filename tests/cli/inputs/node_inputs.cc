// glTF files with unusual scenes and nodes, required extensions and JSON.
#include "tests/cli/inputs/input.h"

namespace input_files {
namespace {

// Returns a scene in which node 1 has the mesh and is the child of node 0. The scene's list of root
// nodes is `roots`.
std::string child(const Json& roots) {
  SceneBuilder scene = band_scene();
  scene.root["nodes"] = {{{"name", "parent"}, {"children", {1}}}, {{"mesh", 0}}};
  scene.root["scenes"][0]["nodes"] = roots;
  return scene.glb();
}

// Returns a scene with a second node that is hidden; if it were visible, it would change the
// voxels. With `by_parent`, the node itself is visible, but its parent is hidden.
std::string hidden(bool is_required, bool by_parent) {
  SceneBuilder scene = band_scene();
  Json node = {{"mesh", 0}, {"translation", {40, 0, 0}}};
  if (by_parent) node = {{"children", {scene.add("nodes", node)}}};
  node["extensions"]["KHR_node_visibility"]["visible"] = false;
  scene.add_root(node);
  if (is_required)
    require_extension(scene, "KHR_node_visibility");
  else
    scene.root["extensionsUsed"] = {"KHR_node_visibility"};
  return scene.glb();
}

std::string requiring(const std::string& extension) {
  SceneBuilder scene = band_scene();
  require_extension(scene, extension);
  return scene.glb();
}

// Returns the mesh as one primitive with both strips. The index 65535, the largest, ends a strip.
std::string restarts() {
  SceneBuilder scene;
  std::vector<uint16_t> indices;
  for (const auto& strip : band().strips) {
    if (!indices.empty()) indices.push_back(0xffff);
    for (const uint32_t index : strip) indices.push_back(static_cast<uint16_t>(index));
  }
  const int positions = scene.add_positions(band().coordinates());
  const int corners = scene.add_accessor("SCALAR", voxdag::test::kU16, indices);
  scene.add_root({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}},
                                           {"indices", corners},
                                           {"mode", 5}})}});
  require_extension(scene, "KHR_mesh_primitive_restart");
  return scene.glb();
}

std::string without_positions() {
  SceneBuilder scene = band_scene();
  scene.root["meshes"][0]["primitives"].push_back({{"attributes", {{"NORMAL", 0}}}});
  return scene.glb();
}

std::string with_nan_bounds() {
  SceneBuilder scene = band_scene();
  scene.root["accessors"][0]["min"] = scene.root["accessors"][0]["max"] = {"@", "@", "@"};
  scene.root["buffers"] = {{{"byteLength", scene.bin.size()}}};
  return voxdag::test::make_glb(replaced(scene.root.dump(), "\"@\"", "NaN"), scene.bin);
}

std::string with_points_in_numbers() {
  SceneBuilder scene = band_scene();
  scene.root["accessors"][1]["count"] = 24.0;
  scene.root["bufferViews"][0]["byteOffset"] = 0.0;
  return scene.glb();
}

// Returns a .glb file with a chunk of an unknown type between the JSON text and the buffer.
std::string with_unknown_chunk() {
  using voxdag::test::little_endian;
  const std::string glb = band_scene().glb();
  const size_t end_of_json = 20 + static_cast<unsigned char>(glb[12]) +
                             256 * static_cast<size_t>(static_cast<unsigned char>(glb[13]));
  const std::string chunk = little_endian(8) + "MORE" + "12345678";
  std::string file = glb.substr(0, end_of_json) + chunk + glb.substr(end_of_json);
  return file.replace(8, 4, little_endian(static_cast<uint32_t>(file.size())));
}

}  // namespace

std::vector<Input> node_inputs() {
  std::vector<Input> all = {
      {"listed node with a parent", child({1}), {}},
      {"parent and child listed", child({0, 1}), {}},
      {"node listed twice", child({0, 0}), {}},
      {"required hidden node", hidden(true, false), {}},
      {"optional hidden node", hidden(false, false), {}},
      {"hidden parent", hidden(false, true), {}},
      {"required extension of materials", requiring("KHR_technique_webgl"), {}},
      {"required extension of polygons", requiring("FB_ngon_encoding"), {}},
      {"restarts of strips", restarts(), {}},
      {"primitive without positions", without_positions(), {}},
      {"NaN as min and max", with_nan_bounds(), {}},
      {"whole numbers with points", with_points_in_numbers(), {}},
      {"unknown chunk", with_unknown_chunk(), {}},
  };
  all[0].warning = all[1].warning = "root-with-parent";
  all[2].warning = "repeated-node";
  all[6].warning = all[7].warning = "harmless-extension";
  all[9].warning = "no-positions";
  return all;
}

}  // namespace input_files
