#include "scene/gltf/document/check_document.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "scene/messages.h"

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

void check_index(const Document& d, size_t size, int index, const std::string& where,
                 const char* what) {
  if (index < 0 || static_cast<size_t>(index) >= size)
    refuse(d.path, where + ": " + what + " " + std::to_string(index) +
                       " does not exist, there are " + std::to_string(size));
}

// Refuses a node that is its own ancestor. Follows the chain of parents of every node; a node that
// occurs twice in one chain is in a cycle. A chain stops at a node of an earlier chain, so each
// node is visited once.
void check_for_cycles(const Document& d) {
  std::vector<int> chain_of(d.nodes.size(), -1);
  for (int start = 0; start < static_cast<int>(d.nodes.size()); ++start) {
    int node = start;
    while (node >= 0 && chain_of[static_cast<size_t>(node)] < 0) {
      chain_of[static_cast<size_t>(node)] = start;
      node = d.nodes[static_cast<size_t>(node)].parent;
    }
    if (node >= 0 && chain_of[static_cast<size_t>(node)] == start)
      refuse(d.path, d.name_node(node) + " is its own ancestor, expected no cycles");
  }
}

// Sets the parent of every node. Refuses a node that has two parents or is its own ancestor.
void link_parents(Document& d) {
  for (int i = 0; i < static_cast<int>(d.nodes.size()); ++i) {
    for (int child : d.nodes[static_cast<size_t>(i)].children) {
      check_index(d, d.nodes.size(), child, d.name_node(i), "child node");
      int& parent = d.nodes[static_cast<size_t>(child)].parent;
      if (parent >= 0)
        refuse(d.path, d.name_node(child) + " has two parents, " + d.name_node(parent) + " and " +
                           d.name_node(i) + ", expected one at most");
      parent = i;
    }
  }
  check_for_cycles(d);
}

// Sets the roots to the nodes of the default scene, or of the first scene if the file names none.
// Without scenes, the roots are all nodes without a parent.
void choose_scene(Document& d) {
  if (d.scenes.empty()) {
    for (int i = 0; i < static_cast<int>(d.nodes.size()); ++i)
      if (d.nodes[static_cast<size_t>(i)].parent < 0) d.roots.push_back(i);
    return;
  }
  const int scene = std::max(d.scene, 0);
  const std::string where = "scene " + std::to_string(scene);
  check_index(d, d.scenes.size(), scene, "the default scene", "scene");
  d.roots = std::move(d.scenes[static_cast<size_t>(scene)]);
  d.scenes.clear();
  std::vector<bool> seen(d.nodes.size());
  for (int root : d.roots) {
    check_index(d, d.nodes.size(), root, where, "node");
    const int parent = d.nodes[static_cast<size_t>(root)].parent;
    if (parent >= 0)
      refuse(d.path, where + ": " + d.name_node(root) + " is not a root: its parent is " +
                         d.name_node(parent));
    if (seen[static_cast<size_t>(root)])
      refuse(d.path, where + ": " + d.name_node(root) + " is listed twice");
    seen[static_cast<size_t>(root)] = true;
  }
}

// Maximum number of elements of an accessor. Indices have 32 bits, so a primitive cannot use more
// vertices than this. The limit also bounds accessors without bytes (all zeros), which could claim
// any count.
constexpr uint64_t kMaxElements = uint64_t{1} << 32;

// `count` elements of `bytes` bytes each; the first is at `offset` of a view.
struct Extent {
  int view;
  uint64_t offset;
  uint64_t count;
  uint64_t bytes;
  bool may_be_strided;
};

void check_view(const Document& d, const BufferView& view, const std::string& where) {
  check_index(d, d.buffers.size(), view.buffer, where, "buffer");
  const BufferSource& buffer = at(d.buffers, view.buffer);
  const std::string name = "buffer " + std::to_string(view.buffer);
  const uint128 end = static_cast<uint128>(view.byte_offset) + view.byte_length;
  if (end > buffer.byte_length)
    refuse(d.path,
           where + " ends past the " + std::to_string(buffer.byte_length) + " bytes of " + name);
  if (buffer.kind == BufferSource::Kind::kNone)
    refuse(d.path, where + ": " + name + " has no uri and is not in the file");
  if (buffer.kind == BufferSource::Kind::kDecoded) check_compressed(d, buffer, where);
}

void check_extent(const Document& d, const Extent& extent, const std::string& where) {
  check_index(d, d.views.size(), extent.view, where, "bufferView");
  const BufferView& view = d.views[static_cast<size_t>(extent.view)];
  const std::string name = "bufferView " + std::to_string(extent.view);
  check_view(d, view, where + ": " + name);
  if (view.byte_stride != 0 && !extent.may_be_strided)
    refuse(d.path, where + ": " + name + " has a byteStride, which is for vertices only");
  if (view.byte_stride != 0 && view.byte_stride < extent.bytes)
    refuse(d.path, where + ": the byteStride of " + name + " is " +
                       std::to_string(view.byte_stride) + ", less than an element of " +
                       std::to_string(extent.bytes) + " bytes");
  if (extent.count == 0) return;
  const uint64_t stride = view.byte_stride != 0 ? view.byte_stride : extent.bytes;
  const uint128 end =
      static_cast<uint128>(extent.count - 1) * stride + extent.offset + extent.bytes;
  if (end > view.byte_length)
    refuse(d.path,
           where + " ends past the " + std::to_string(view.byte_length) + " bytes of " + name);
}

void check_sparse(const Document& d, const Accessor& accessor, const std::string& where) {
  const Sparse& sparse = accessor.sparse;
  if (sparse.count > accessor.count)
    refuse(d.path, where + " has " + std::to_string(sparse.count) + " sparse replacements for " +
                       std::to_string(accessor.count) + " elements");
  if (sparse.index_type != kUnsignedByte && sparse.index_type != kUnsignedShort &&
      sparse.index_type != kUnsignedInt)
    refuse(d.path, where + ": its sparse indices are not unsigned integers");
  const auto index_bytes = static_cast<uint64_t>(component_bytes(sparse.index_type));
  check_extent(d, {sparse.index_view, sparse.index_offset, sparse.count, index_bytes, false},
               where + ": its sparse indices");
  check_extent(
      d, {sparse.value_view, sparse.value_offset, sparse.count, element_bytes(accessor), false},
      where + ": its sparse values");
}

void check_type(const Document& d, const Accessor& accessor, const AccessorUse& use,
                const std::string& where) {
  const auto among = [&](const std::vector<int>& types) {
    return std::ranges::find(types, accessor.component_type) != types.end();
  };
  const std::string type = component_name(accessor.component_type);
  if (accessor.components != use.components)
    refuse(d.path, where + " has " + std::to_string(accessor.components) +
                       " components, expected " + std::to_string(use.components));
  if (!among(use.types)) {
    std::string expected;
    for (int t : use.types)
      expected += (expected.empty() ? "" : " or ") + std::string(component_name(t));
    refuse(d.path, where + " has components of type " + type + ", expected " + expected);
  }
  if (accessor.normalized && !among(use.may_be_normalized))
    refuse(d.path,
           where + " has normalized components of type " + type + ", expected them not normalized");
}

}  // namespace

void check_accessor(const Document& d, int index, const AccessorUse& use) {
  if (index < 0) return;
  check_index(d, d.accessors.size(), index, use.where, "accessor");
  const Accessor& accessor = d.accessors[static_cast<size_t>(index)];
  const std::string where = use.where + ": " + d.name_accessor(index);
  check_type(d, accessor, use, where);
  if (accessor.count > kMaxElements)
    throw Error(ErrorCode::kLimit, d.path + ": " + where + " has " +
                                       std::to_string(accessor.count) +
                                       " elements, the limit is 2^32");
  const bool is_indices = use.components == 1;
  if (accessor.view >= 0)
    check_extent(
        d,
        {accessor.view, accessor.byte_offset, accessor.count, element_bytes(accessor), !is_indices},
        where);
  if (accessor.is_sparse) check_sparse(d, accessor, where);
}

void check_count(const Document& d, int index, uint64_t count, const std::string& where) {
  if (index < 0) return;
  const uint64_t found = d.accessors[static_cast<size_t>(index)].count;
  if (found != count)
    refuse(d.path, where + ": " + d.name_accessor(index) + " has " + std::to_string(found) +
                       " elements, expected " + std::to_string(count));
}

std::vector<int> buffers_of(const Document& d, const Accessor& accessor) {
  std::vector<int> buffers;
  const auto add = [&](int view) {
    if (view < 0) return;
    const int buffer = at(d.views, view).buffer;
    const BufferSource& source = at(d.buffers, buffer);
    buffers.push_back(buffer);
    if (source.meshopt) buffers.push_back(source.meshopt->from.buffer);
    if (source.draco) buffers.push_back(source.draco->from.buffer);
  };
  add(accessor.view);
  if (accessor.is_sparse) {
    add(accessor.sparse.index_view);
    add(accessor.sparse.value_view);
  }
  return buffers;
}

namespace {

// If `index` is not -1, checks this accessor of the geometry and marks its buffers as read.
void check_geometry(Document& d, int index, const AccessorUse& use) {
  if (index < 0) return;
  check_accessor(d, index, use);
  for (int buffer : buffers_of(d, at(d.accessors, index)))
    d.buffers[static_cast<size_t>(buffer)].is_read = true;
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
    check_geometry(d, set.joints, joints);
    check_geometry(d, set.weights, weights);
    check_count(d, set.joints, vertices, joints.where);
    check_count(d, set.weights, vertices, weights.where);
  }
}

void warn_of_leftovers(Document& d, const Primitive& primitive, const std::string& where) {
  const int corners = primitive.indices >= 0 ? primitive.indices : primitive.position;
  if (primitive.mode != kTriangleList || at(d.accessors, corners).count % 3 == 0) return;
  d.warn("surplus-corners", where + ": " + d.name_accessor(corners),
         "its count is not a multiple of three; the surplus corners are ignored");
}

void check_triangles(Document& d, Primitive& primitive, const std::vector<double>& weights,
                     const std::string& where) {
  if (primitive.position < 0) refuse(d.path, where + " has no POSITION");
  place_draco_primitive(d, primitive, where);
  check_geometry(d, primitive.position, position_use(d, where + ": POSITION"));
  check_geometry(d, primitive.indices,
                 {where + ": indices", 1, {kUnsignedByte, kUnsignedShort, kUnsignedInt}});
  const uint64_t vertices = at(d.accessors, primitive.position).count;
  for (int target : primitive.targets) {
    check_geometry(d, target, displacement_use(d, where + ": POSITION of a morph target"));
    check_count(d, target, vertices, where + ": POSITION of a morph target");
  }
  check_joint_sets(d, primitive, vertices, where);
  check_weights(d, weights, primitive, where);
  warn_of_leftovers(d, primitive, where);
}

void check_mesh(Document& d, int index) {
  Mesh& mesh = d.meshes[static_cast<size_t>(index)];
  int without_triangles = 0;
  for (int p = 0; p < size_of(mesh.primitives); ++p) {
    Primitive& primitive = mesh.primitives[static_cast<size_t>(p)];
    const std::string where = d.name_mesh(index) + ": primitive " + std::to_string(p);
    if (primitive.mode > kTriangleFan)
      refuse(d.path, where + " has mode " + std::to_string(primitive.mode) + ", expected 0 to 6");
    if (primitive.makes_triangles())
      check_triangles(d, primitive, mesh.weights, where);
    else
      ++without_triangles;
  }
  if (without_triangles > 0)
    d.warn("points-or-lines", d.name_mesh(index), "primitives of points or lines make no voxels",
           static_cast<uint64_t>(without_triangles));
}

void check_skin(Document& d, int index) {
  const Skin& skin = at(d.skins, index);
  const std::string where = d.name_skin(index);
  if (skin.joints.empty()) refuse(d.path, where + " has no joints");
  for (int joint : skin.joints) check_index(d, d.nodes.size(), joint, where, "joint node");
  check_geometry(d, skin.inverse_bind, {where + ": inverseBindMatrices", 16, {kFloat}});
  if (skin.inverse_bind >= 0 && at(d.accessors, skin.inverse_bind).count < skin.joints.size())
    refuse(d.path, where + " has fewer inverse bind matrices than joints");
}

void check_instancing(Document& d, const Node& node, const std::string& where) {
  const Instancing& instancing = node.instancing;
  if (!instancing.present) return;
  if (node.skin >= 0)
    refuse(d.path, where + " has a skin and EXT_mesh_gpu_instancing, which do not go together");
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
  place_meshopt_views(d);
  for (int i = 0; i < size_of(d.meshes); ++i) check_mesh(d, i);
  for (int i = 0; i < size_of(d.skins); ++i) check_skin(d, i);
  for (int i = 0; i < size_of(d.nodes); ++i) check_node(d, i);
}

}  // namespace voxdag::gltf
