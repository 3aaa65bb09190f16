#include "scene/generate/glb_layout.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "scene/glb_arrays.h"

namespace voxdag {
namespace {

using nlohmann::json;

json vectors(uint64_t count) {
  return {{"componentType", kGlbFloat}, {"type", "VEC3"}, {"count", count}};
}

// Returns a primitive whose arrays are consecutive, starting with the array number `positions`.
json primitive(uint64_t positions, bool has_colors, uint32_t material) {
  if (!has_colors) return {{"attributes", {{"POSITION", positions}}}, {"indices", positions + 1}};
  return {{"attributes", {{"POSITION", positions}, {"COLOR_0", positions + 1}}},
          {"indices", positions + 2},
          {"material", material}};
}

json material_json(const SceneMaterial& material) {
  const auto [red, green, blue] = material.base_color;
  return {{"name", material.name},
          {"pbrMetallicRoughness",
           {{"baseColorFactor", {red, green, blue, 1}},
            {"metallicFactor", 0},
            {"roughnessFactor", 1}}}};
}

json instancing_node(uint64_t part, uint64_t translations) {
  const json attributes = {{"TRANSLATION", translations}, {"SCALE", translations + 1}};
  return {{"mesh", part},
          {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}};
}

}  // namespace

void GlbLayout::mesh(const MeshBuilder& mesh) {
  cancel_.check();
  add_geometry(Kind::kMesh, mesh);
  triangles_ += mesh.triangles();
  progress_.advance(mesh.triangles());
}

void GlbLayout::part(const MeshBuilder& mesh) {
  add_geometry(Kind::kPart, mesh);
  part_triangles_.push_back(mesh.triangles());
}

void GlbLayout::instances(uint32_t part, std::span<const Float3> translations,
                          std::span<const Float3>) {
  const auto count = static_cast<uint32_t>(translations.size());
  blocks_.push_back({Kind::kInstances, part, count, 0, {}, {}, 0, false});
  instance_count_ += count;
  triangles_ += count * part_triangles_[part];
  add_bytes(2 * sizeof(Float3) * uint64_t{count});
}

void GlbLayout::add_geometry(Kind kind, const MeshBuilder& mesh) {
  Block block{kind,
              0,
              mesh.vertices(),
              3 * mesh.triangles(),
              mesh.positions[0],
              mesh.positions[0],
              mesh.material,
              !mesh.colors.empty()};
  for (const Float3& p : mesh.positions)
    for (size_t axis = 0; axis < 3; ++axis) {
      block.low[axis] = std::min(block.low[axis], p[axis]);
      block.high[axis] = std::max(block.high[axis], p[axis]);
    }
  blocks_.push_back(block);
  stored_triangles_ += mesh.triangles();
  add_bytes((sizeof(Float3) + (block.has_colors ? sizeof(Rgba8) : 0)) * uint64_t{block.first} +
            padded_index_bytes(block.second));
}

void GlbLayout::add_bytes(uint64_t bytes) {
  bin_bytes_ += bytes;
  if (bin_bytes_ > kMaxGlbBytes)
    throw Error(ErrorCode::kLimit,
                "the limit of a .glb is 4 294 967 295 bytes, which this scene exceeds after " +
                    std::to_string(stored_triangles_) + " triangles: expected fewer triangles");
}

// Parts come first, so that part p is mesh p. The last mesh has all triangles that are not
// instanced. There is one node for this mesh, and one for each block of instances.
std::string GlbLayout::json_text(const std::string& generator,
                                 std::span<const SceneMaterial> materials) const {
  GlbArrays arrays;
  json meshes = json::array(), nodes = json::array(), primitives = json::array();
  for (const Block& b : blocks_) {
    const uint64_t array = arrays.views.size();
    const uint64_t bytes = sizeof(Float3) * uint64_t{b.first};
    if (b.kind == Kind::kInstances) {
      nodes.push_back(instancing_node(b.part, array));
      for (int i = 0; i < 2; ++i) arrays.add(bytes, bytes, 0, vectors(b.first));
      continue;
    }
    if (b.kind == Kind::kPart)
      meshes.push_back({{"primitives", json::array({primitive(array, b.has_colors, b.material)})}});
    else
      primitives.push_back(primitive(array, b.has_colors, b.material));
    json positions = vectors(b.first);
    positions["min"] = b.low;
    positions["max"] = b.high;
    arrays.add(bytes, bytes, kGlbVertices, std::move(positions));
    if (b.has_colors)
      arrays.add(sizeof(Rgba8) * uint64_t{b.first}, sizeof(Rgba8) * uint64_t{b.first}, kGlbVertices,
                 {{"componentType", kGlbUint8},
                  {"normalized", true},
                  {"type", "VEC4"},
                  {"count", b.first}});
    arrays.add(sizeof(uint16_t) * uint64_t{b.second}, padded_index_bytes(b.second), kGlbIndices,
               {{"componentType", kGlbUint16}, {"type", "SCALAR"}, {"count", b.second}});
  }
  if (!primitives.empty()) {
    nodes.push_back({{"mesh", meshes.size()}});
    meshes.push_back({{"primitives", std::move(primitives)}});
  }
  std::vector<size_t> roots(nodes.size());
  for (size_t i = 0; i < roots.size(); ++i) roots[i] = i;

  json root = {{"asset", {{"version", "2.0"}, {"generator", generator}}},
               {"scene", 0},
               {"scenes", json::array({{{"nodes", roots}}})},
               {"nodes", std::move(nodes)},
               {"meshes", std::move(meshes)},
               {"accessors", std::move(arrays.accessors)},
               {"bufferViews", std::move(arrays.views)},
               {"buffers", json::array({{{"byteLength", bin_bytes_}}})}};
  for (const SceneMaterial& material : materials)
    root["materials"].push_back(material_json(material));
  if (instance_count_ > 0)
    root["extensionsUsed"] = root["extensionsRequired"] = json::array({"EXT_mesh_gpu_instancing"});
  return exact_json_text(root);
}

}  // namespace voxdag
