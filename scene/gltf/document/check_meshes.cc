#include "scene/gltf/document/check_meshes.h"

#include <algorithm>
#include <utility>

#include "scene/gltf/document/check_document.h"
#include "scene/gltf/json/array_access.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

// Warns if the view has a byteStride that glTF does not allow.
void warn_of_stride(Document& d, int view, bool is_vertices) {
  const uint64_t stride = view < 0 ? 0 : at(d.views, view).byte_stride;
  if (stride == 0 || (is_vertices && stride <= 252 && stride % 4 == 0)) return;
  d.warn("byte-stride", "bufferView " + std::to_string(view),
         "its byteStride of " + std::to_string(stride) +
             (is_vertices ? " is used, expected a multiple of 4 up to 252"
                          : " is used, expected none because it is not for vertices"));
}

// Warns if an accessor has integers that glTF allows only with KHR_mesh_quantization.
void warn_of_quantization(Document& d, int index, const std::string& where) {
  if (index < 0 || d.quantized || at(d.accessors, index).component_type == kFloat) return;
  d.warn("undeclared-quantization", where + ": " + d.name_accessor(index),
         "has integers, but the file does not declare KHR_mesh_quantization; they are read");
}

// Checks accessor `index`, a part of the geometry, and marks its buffers as read. Does nothing if
// `index` is -1.
void check_geometry(Document& d, int index, const AccessorUse& use) {
  if (index < 0) return;
  check_accessor(d, index, use);
  const Accessor& accessor = at(d.accessors, index);
  warn_of_stride(d, accessor.view, use.components > 1);
  if (accessor.is_sparse) {
    warn_of_stride(d, accessor.sparse.index_view, false);
    warn_of_stride(d, accessor.sparse.value_view, false);
  }
  for (int buffer : buffers_of(d, accessor)) d.buffers[static_cast<size_t>(buffer)].is_read = true;
}

AccessorUse position_use(const std::string& where) {
  return {where,
          3,
          {kFloat, kByte, kUnsignedByte, kShort, kUnsignedShort},
          {kByte, kUnsignedByte, kShort, kUnsignedShort}};
}

AccessorUse displacement_use(const std::string& where) {
  return {where, 3, {kFloat, kByte, kShort}, {kByte, kShort}};
}

// Warns if the number of morph weights differs from the number of the mesh's targets.
void check_weights(Document& d, const std::vector<double>& weights, const Mesh& mesh,
                   const std::string& where) {
  size_t targets = 0;
  for (const Primitive& primitive : mesh.primitives)
    if (primitive.makes_triangles()) targets = std::max(targets, primitive.targets.size());
  if (!weights.empty() && weights.size() != targets)
    d.warn("morph-weights", where,
           "the number of morph weights is not the number of morph targets; surplus weights are "
           "ignored, and missing weights are 0");
}

void check_joint_sets(Document& d, const Primitive& primitive, const std::string& where) {
  const AccessorUse joints{where + ": JOINTS", 4, {kUnsignedByte, kUnsignedShort}};
  const AccessorUse weights{where + ": WEIGHTS",
                            4,
                            {kFloat, kUnsignedByte, kUnsignedShort},
                            {kUnsignedByte, kUnsignedShort}};
  for (size_t i = 0; i < primitive.joint_sets.size(); ++i) {
    const JointSet& set = primitive.joint_sets[i];
    const std::string n = "_" + std::to_string(i);
    if (set.weights < 0)
      refuse(d.path, where + " has JOINTS" + n + " without WEIGHTS" + n + ": expected both");
    if (set.joints < 0)
      refuse(d.path, where + " has WEIGHTS" + n + " without JOINTS" + n + ": expected both");
    check_geometry(d, set.joints, joints);
    check_geometry(d, set.weights, weights);
  }
}

void warn_of_leftovers(Document& d, const Primitive& primitive, const std::string& where) {
  const int corners = primitive.indices >= 0 ? primitive.indices : primitive.position;
  if (primitive.mode != kTriangleList || at(d.accessors, corners).count % 3 == 0) return;
  d.warn("surplus-corners", where + ": " + d.name_accessor(corners),
         "its count is not a multiple of three; the surplus corners are ignored");
}

void check_triangles(Document& d, Primitive& primitive, const std::string& where) {
  place_draco_primitive(d, primitive, where);
  check_geometry(d, primitive.position, position_use(where + ": POSITION"));
  warn_of_quantization(d, primitive.position, where + ": POSITION");
  check_geometry(d, primitive.indices,
                 {where + ": indices", 1, {kUnsignedByte, kUnsignedShort, kUnsignedInt}});
  for (int target : primitive.targets) {
    check_geometry(d, target, displacement_use(where + ": POSITION of a morph target"));
    warn_of_quantization(d, target, where + ": POSITION of a morph target");
  }
  check_joint_sets(d, primitive, where);
  // The counts in Draco data can differ from the accessors' counts. correct_draco_counts() checks
  // them later.
  if (!decoded_buffer(d, primitive)) check_vertex_counts(d, primitive, where);
  warn_of_leftovers(d, primitive, where);
}

void check_mesh(Document& d, int index) {
  Mesh& mesh = d.meshes[static_cast<size_t>(index)];
  uint64_t without_triangles = 0, without_positions = 0;
  for (int p = 0; p < size_of(mesh.primitives); ++p) {
    Primitive& primitive = mesh.primitives[static_cast<size_t>(p)];
    const std::string where = d.name_mesh(index) + ": primitive " + std::to_string(p);
    if (primitive.mode > kTriangleFan)
      refuse(d.path, where + " has mode " + std::to_string(primitive.mode) + ", expected 0 to 6");
    if (primitive.makes_triangles())
      check_triangles(d, primitive, where);
    else
      ++(primitive.mode < kTriangleList ? without_triangles : without_positions);
  }
  if (without_triangles > 0)
    d.warn("points-or-lines", d.name_mesh(index), "primitives of points or lines make no voxels",
           without_triangles);
  if (without_positions > 0)
    d.warn("no-positions", d.name_mesh(index), "primitives without POSITION make no voxels",
           without_positions);
  check_weights(d, mesh.weights, mesh, d.name_mesh(index));
}

void check_skin(Document& d, int index) {
  const Skin& skin = at(d.skins, index);
  const std::string where = d.name_skin(index);
  if (skin.joints.empty()) refuse(d.path, where + " has no joints, expected at least one");
  for (int joint : skin.joints) check_index(d, d.nodes.size(), joint, where, "joint node");
  check_geometry(d, skin.inverse_bind, {where + ": inverseBindMatrices", 16, {kFloat}});
  if (skin.inverse_bind >= 0 && at(d.accessors, skin.inverse_bind).count < skin.joints.size())
    refuse(d.path, where + " has " + std::to_string(at(d.accessors, skin.inverse_bind).count) +
                       " inverse bind matrices, expected " + std::to_string(skin.joints.size()) +
                       ", the number of its joints");
}

void check_instancing(Document& d, const Node& node, const std::string& where) {
  const Instancing& instancing = node.instancing;
  if (!instancing.present) return;
  if (node.skin >= 0)
    refuse(d.path, where + " has a skin and EXT_mesh_gpu_instancing, expected at most one of them");
  const std::string of = where + ": EXT_mesh_gpu_instancing";
  check_geometry(d, instancing.translation, {of + ": TRANSLATION", 3, {kFloat}});
  check_geometry(d, instancing.rotation,
                 {of + ": ROTATION", 4, {kFloat, kByte, kShort}, {kByte, kShort}});
  check_geometry(d, instancing.scale, {of + ": SCALE", 3, {kFloat}});
  const uint64_t instances = instance_count(d, node);
  for (int accessor : {instancing.translation, instancing.rotation, instancing.scale})
    check_count(d, accessor, instances, of);
}

void check_node(Document& d, int index) {
  const Node& node = at(d.nodes, index);
  const std::string where = d.name_node(index);
  const Mesh& mesh = at(d.meshes, node.mesh);
  check_instancing(d, node, where);
  check_weights(d, node.weights, mesh, where);
  if (node.skin < 0) return;
  const auto unskinned = std::ranges::count_if(mesh.primitives, [](const Primitive& primitive) {
    return primitive.makes_triangles() && primitive.joint_sets.empty();
  });
  if (unskinned > 0)
    d.warn("unskinned-primitives", where,
           "has a skin, but primitives of its mesh have no joints; they are placed by the node",
           static_cast<uint64_t>(unskinned));
}

// Returns the nodes of the scene that draw a mesh.
std::vector<int> drawing_nodes(const Document& d) {
  std::vector<bool> is_in_scene(d.nodes.size());
  std::vector<int> left = d.roots;
  while (!left.empty()) {
    const int node = left.back();
    left.pop_back();
    is_in_scene[static_cast<size_t>(node)] = true;
    const std::vector<int>& children = at(d.nodes, node).children;
    left.insert(left.end(), children.begin(), children.end());
  }
  std::vector<int> drawing;
  for (int i = 0; i < size_of(d.nodes); ++i)
    if (is_in_scene[static_cast<size_t>(i)] && at(d.nodes, i).mesh >= 0) drawing.push_back(i);
  return drawing;
}

}  // namespace

BufferSource* decoded_buffer(Document& d, const Primitive& primitive) {
  const int view = at(d.accessors, primitive.position).view;
  if (view < 0) return nullptr;
  BufferSource& buffer = d.buffers[static_cast<size_t>(at(d.views, view).buffer)];
  return buffer.draco ? &buffer : nullptr;
}

void check_vertex_counts(const Document& d, const Primitive& primitive, const std::string& where) {
  const uint64_t vertices = at(d.accessors, primitive.position).count;
  for (int target : primitive.targets)
    check_count(d, target, vertices, where + ": POSITION of a morph target");
  for (const JointSet& set : primitive.joint_sets) {
    check_count(d, set.joints, vertices, where + ": JOINTS");
    check_count(d, set.weights, vertices, where + ": WEIGHTS");
  }
}

void check_drawn_meshes(Document& d) {
  const std::vector<int> nodes = drawing_nodes(d);
  std::vector<bool> has_skin(d.skins.size());
  for (int node : nodes) {
    const auto [mesh, skin] = std::pair(at(d.nodes, node).mesh, at(d.nodes, node).skin);
    check_index(d, d.meshes.size(), mesh, d.name_node(node), "mesh");
    d.check_usable("meshes", mesh);
    d.meshes[static_cast<size_t>(mesh)].is_drawn = true;
    if (skin < 0) continue;
    check_index(d, d.skins.size(), skin, d.name_node(node), "skin");
    d.check_usable("skins", skin);
    has_skin[static_cast<size_t>(skin)] = true;
  }
  for (int i = 0; i < size_of(d.meshes); ++i)
    if (at(d.meshes, i).is_drawn) check_mesh(d, i);
  for (int i = 0; i < size_of(d.skins); ++i)
    if (has_skin[static_cast<size_t>(i)]) check_skin(d, i);
  for (int node : nodes) check_node(d, node);
}

}  // namespace voxdag::gltf
