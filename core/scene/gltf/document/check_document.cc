#include "core/scene/gltf/document/check_document.h"

#include "core/scene/gltf/document/accessor_checks.h"
#include "core/scene/gltf/document/hierarchy.h"
#include "core/scene/gltf/messages.h"

namespace voxdag::gltf {
namespace {

template <class Array>
int size_of(const Array& a) {
  return static_cast<int>(a.size());
}
template <class Array>
const auto& at(const Array& a, int i) {
  return a[static_cast<size_t>(i)];
}

AccessorUse position_use(const Document& d, const std::string& where) {
  if (!d.quantized) return {where, 3, {kFloat}};
  return {where,
          3,
          {kFloat, kByte, kUnsignedByte, kShort, kUnsignedShort},
          {kByte, kUnsignedByte, kShort, kUnsignedShort}};
}

AccessorUse displacement_use(const Document& d, const std::string& where) {
  if (!d.quantized) return {where, 3, {kFloat}};
  return {where, 3, {kFloat, kByte, kShort}, {kByte, kShort}};
}

void check_weights(const Document& d, const std::vector<double>& weights,
                   const Primitive& primitive, const std::string& where) {
  if (!weights.empty() && weights.size() != primitive.targets.size())
    refuse(d.path, where + " has " + std::to_string(weights.size()) + " morph weights, expected " +
                       std::to_string(primitive.targets.size()));
}

void check_joint_sets(Document& d, const Primitive& primitive, uint64_t vertices,
                      const std::string& where) {
  const AccessorUse joints{where + ": JOINTS", 4, {kUnsignedByte, kUnsignedShort}};
  const AccessorUse weights{where + ": WEIGHTS",
                            4,
                            {kFloat, kUnsignedByte, kUnsignedShort},
                            {kUnsignedByte, kUnsignedShort}};
  for (const JointSet& set : primitive.joint_sets) {
    if (set.joints < 0 || set.weights < 0)
      refuse(d.path, where + " has JOINTS_n without WEIGHTS_n of the same n, or the reverse");
    check_accessor(d, set.joints, joints);
    check_accessor(d, set.weights, weights);
    check_count(d, set.joints, vertices, joints.where);
    check_count(d, set.weights, vertices, weights.where);
  }
}

// The accessors of a compressed primitive may have no bytes of their own.
void check_draco(const Document& d, const Primitive& primitive, const std::string& where) {
  if (!primitive.draco) return;
  for (int accessor : {primitive.position, primitive.indices})
    if (accessor >= 0 && at(d.accessors, accessor).view < 0)
      refuse(d.path,
             where + " is compressed by KHR_draco_mesh_compression, which voxdag does not read");
}

void warn_of_leftovers(Document& d, const Primitive& primitive, const std::string& where) {
  const int corners = primitive.indices >= 0 ? primitive.indices : primitive.position;
  if (primitive.mode != kTriangleList || at(d.accessors, corners).count % 3 == 0) return;
  d.warn(where + ": " + d.name_accessor(corners) +
         " is no multiple of three, the corners left over are ignored");
}

void check_triangles(Document& d, const Primitive& primitive, const std::vector<double>& weights,
                     const std::string& where) {
  if (primitive.position < 0) refuse(d.path, where + " has no POSITION");
  check_accessor(d, primitive.position, position_use(d, where + ": POSITION"));
  check_accessor(d, primitive.indices,
                 {where + ": indices", 1, {kUnsignedByte, kUnsignedShort, kUnsignedInt}});
  check_draco(d, primitive, where);
  const uint64_t vertices = at(d.accessors, primitive.position).count;
  for (int target : primitive.targets) {
    check_accessor(d, target, displacement_use(d, where + ": POSITION of a morph target"));
    check_count(d, target, vertices, where + ": POSITION of a morph target");
  }
  check_joint_sets(d, primitive, vertices, where);
  check_weights(d, weights, primitive, where);
  warn_of_leftovers(d, primitive, where);
}

void check_mesh(Document& d, int index) {
  const Mesh& mesh = at(d.meshes, index);
  int without_triangles = 0;
  for (int p = 0; p < size_of(mesh.primitives); ++p) {
    const Primitive& primitive = at(mesh.primitives, p);
    const std::string where = d.name_mesh(index) + ": primitive " + std::to_string(p);
    if (primitive.mode > kTriangleFan)
      refuse(d.path, where + " has mode " + std::to_string(primitive.mode) + ", expected 0 to 6");
    if (primitive.makes_triangles())
      check_triangles(d, primitive, mesh.weights, where);
    else
      ++without_triangles;
  }
  if (without_triangles > 0)
    d.warn(d.name_mesh(index) + " has " + std::to_string(without_triangles) +
           " primitives of points or lines, which make no voxels");
}

void check_skin(Document& d, int index) {
  const Skin& skin = at(d.skins, index);
  const std::string where = d.name_skin(index);
  if (skin.joints.empty()) refuse(d.path, where + " has no joints");
  for (int joint : skin.joints) check_index(d, d.nodes.size(), joint, where, "joint node");
  check_accessor(d, skin.inverse_bind, {where + ": inverseBindMatrices", 16, {kFloat}});
  if (skin.inverse_bind >= 0 && at(d.accessors, skin.inverse_bind).count < skin.joints.size())
    refuse(d.path, where + " has fewer inverse bind matrices than joints");
}

void check_instancing(Document& d, const Node& node, const std::string& where) {
  const Instancing& instancing = node.instancing;
  if (!instancing.present) return;
  if (node.skin >= 0)
    refuse(d.path, where + " has a skin and EXT_mesh_gpu_instancing, which do not go together");
  const std::string of = where + ": EXT_mesh_gpu_instancing";
  check_accessor(d, instancing.translation, {of + ": TRANSLATION", 3, {kFloat}});
  check_accessor(d, instancing.rotation,
                 {of + ": ROTATION", 4, {kFloat, kByte, kShort}, {kByte, kShort}});
  check_accessor(d, instancing.scale, {of + ": SCALE", 3, {kFloat}});
  const uint64_t instances = instance_count(d, node);
  for (int accessor : {instancing.translation, instancing.rotation, instancing.scale})
    check_count(d, accessor, instances, of);
}

void check_node(Document& d, int index) {
  const Node& node = at(d.nodes, index);
  const std::string where = d.name_node(index);
  if (node.skin >= 0) check_index(d, d.skins.size(), node.skin, where, "skin");
  if (node.mesh < 0) return;
  check_index(d, d.meshes.size(), node.mesh, where, "mesh");
  check_instancing(d, node, where);
  for (const Primitive& primitive : at(d.meshes, node.mesh).primitives) {
    if (!primitive.makes_triangles()) continue;
    check_weights(d, node.weights, primitive, where);
    if (node.skin >= 0 && primitive.joint_sets.empty())
      refuse(d.path, where + " has a skin, but " + d.name_mesh(node.mesh) +
                         " has a primitive without JOINTS_0 and WEIGHTS_0");
  }
}

}  // namespace

void check_document(Document& d) {
  link_parents(d);
  choose_scene(d);
  for (int i = 0; i < size_of(d.meshes); ++i) check_mesh(d, i);
  for (int i = 0; i < size_of(d.skins); ++i) check_skin(d, i);
  for (int i = 0; i < size_of(d.nodes); ++i) check_node(d, i);
}

}  // namespace voxdag::gltf
