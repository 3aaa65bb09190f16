#include <algorithm>
#include <initializer_list>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "core/scene/gltf/read_document.h"

namespace voxdag::gltf {
namespace {

// Vertices are addressed by 32-bit indices, so more in one primitive are of no use; also bounds
// what an accessor without bytes (all zeros) can claim.
constexpr uint64_t kMostElements = uint64_t{1} << 32;

class Checker {
 public:
  explicit Checker(Document& document) : d_(document) {}

  void check_all() {
    check_hierarchy();
    choose_scene();
    for (int i = 0; i < count(d_.skins); ++i) check_skin(i);
    for (int i = 0; i < count(d_.meshes); ++i) check_mesh(i);
    for (int i = 0; i < count(d_.nodes); ++i) check_node(i);
  }

 private:
  template <class T>
  static int count(const std::vector<T>& v) {
    return static_cast<int>(v.size());
  }
  template <class T>
  static auto& at(T& v, int i) {
    return v[static_cast<size_t>(i)];
  }

  [[noreturn]] void fail(const std::string& where, const std::string& what) const {
    refuse(d_.path, where + ": " + what);
  }

  // `index` must be one of `all`, called `what`.
  template <class T>
  void check_index(const std::vector<T>& all, int index, const std::string& where,
                   const char* what) const {
    if (index < 0 || index >= count(all))
      fail(where, std::string(what) + " " + std::to_string(index) + " does not exist, there are " +
                      std::to_string(all.size()));
  }

  // Every node has one parent at most, and following parents ends.
  void check_hierarchy() {
    for (int i = 0; i < count(d_.nodes); ++i) {
      for (int child : at(d_.nodes, i).children) {
        check_index(d_.nodes, child, d_.name_node(i), "child node");
        int& parent = at(d_.nodes, child).parent;
        if (parent >= 0)
          fail(d_.name_node(child), "has two parents, " + d_.name_node(parent) + " and " +
                                        d_.name_node(i) + ", expected one at most");
        parent = i;
      }
    }
    std::vector<int> seen_from(d_.nodes.size(), -1);
    for (int i = 0; i < count(d_.nodes); ++i) {
      int node = i;
      while (node >= 0 && at(seen_from, node) < 0) {
        at(seen_from, node) = i;
        node = at(d_.nodes, node).parent;
      }
      if (node >= 0 && at(seen_from, node) == i)
        fail(d_.name_node(node), "is its own ancestor, expected a hierarchy without cycles");
    }
  }

  // The default scene, else the first, else all that has no parent.
  void choose_scene() {
    if (d_.scenes.empty()) {
      for (int i = 0; i < count(d_.nodes); ++i)
        if (at(d_.nodes, i).parent < 0) d_.roots.push_back(i);
      return;
    }
    const int scene = std::max(d_.scene, 0);
    check_index(d_.scenes, scene, "the default scene", "scene");
    d_.roots = std::move(at(d_.scenes, scene));
    d_.scenes.clear();
    std::vector<bool> seen(d_.nodes.size());
    for (int root : d_.roots) {
      const std::string where = "scene " + std::to_string(scene);
      check_index(d_.nodes, root, where, "node");
      if (at(d_.nodes, root).parent >= 0)
        fail(where, d_.name_node(root) + " is no root, " + d_.name_node(at(d_.nodes, root).parent) +
                        " is its parent");
      if (seen[static_cast<size_t>(root)]) fail(where, d_.name_node(root) + " is listed twice");
      seen[static_cast<size_t>(root)] = true;
    }
  }

  void check_node(int i) {
    const Node& node = at(d_.nodes, i);
    const std::string where = d_.name_node(i);
    if (node.mesh >= 0) check_index(d_.meshes, node.mesh, where, "mesh");
    if (node.skin >= 0) check_index(d_.skins, node.skin, where, "skin");
    if (node.mesh < 0) return;
    check_instancing(node, where);
    for (const Primitive& primitive : at(d_.meshes, node.mesh).primitives) {
      if (!primitive.makes_triangles()) continue;
      check_weights(node.weights, primitive, where);
      if (node.skin >= 0 && primitive.joint_sets.empty())
        fail(where, "has " + d_.name_skin(node.skin) + ", but " + d_.name_mesh(node.mesh) +
                        " has a primitive without JOINTS_0 and WEIGHTS_0");
    }
  }

  void check_instancing(const Node& node, const std::string& where) const {
    const Instancing& instancing = node.instancing;
    if (!instancing.present) return;
    if (node.skin >= 0)
      fail(where, "has a skin and EXT_mesh_gpu_instancing, which do not go together");
    const std::string of = where + ": EXT_mesh_gpu_instancing: ";
    check_use(instancing.translation, {of + "TRANSLATION", 3, {kFloat}});
    check_use(instancing.rotation, {of + "ROTATION", 4, {kFloat, kByte, kShort}, {kByte, kShort}});
    check_use(instancing.scale, {of + "SCALE", 3, {kFloat}});
    const uint64_t instances = instance_count(d_, node);
    for (int accessor : {instancing.translation, instancing.rotation, instancing.scale})
      if (accessor >= 0 && at(d_.accessors, accessor).count != instances)
        fail(of + d_.name_accessor(accessor), "its count differs from the others'");
  }

  void check_skin(int i) const {
    const Skin& skin = at(d_.skins, i);
    const std::string where = d_.name_skin(i);
    if (skin.joints.empty()) fail(where, "has no joints");
    for (int joint : skin.joints) check_index(d_.nodes, joint, where, "joint node");
    check_use(skin.inverse_bind, {where + ": inverseBindMatrices", 16, {kFloat}});
    if (skin.inverse_bind >= 0 && at(d_.accessors, skin.inverse_bind).count < skin.joints.size())
      fail(where, "has fewer inverse bind matrices than joints");
  }

  void check_mesh(int i) {
    const Mesh& mesh = at(d_.meshes, i);
    int without_triangles = 0;
    for (int p = 0; p < count(mesh.primitives); ++p) {
      const Primitive& primitive = at(mesh.primitives, p);
      const std::string where = d_.name_mesh(i) + ": primitive " + std::to_string(p);
      if (primitive.mode > 6)
        fail(where, "mode " + std::to_string(primitive.mode) + " does not exist");
      if (primitive.makes_triangles())
        check_primitive(primitive, where, mesh.weights);
      else
        ++without_triangles;
    }
    if (without_triangles > 0)
      d_.warnings.push_back(d_.path + ": " + d_.name_mesh(i) + ": " +
                            std::to_string(without_triangles) +
                            " primitives of points or lines make no voxels");
  }

  void check_primitive(const Primitive& primitive, const std::string& where,
                       const std::vector<double>& weights) {
    if (primitive.position < 0) fail(where, "has no POSITION");
    Use position{where + ": POSITION", 3, {kFloat}};
    Use target{where + ": POSITION of a morph target", 3, {kFloat}};
    if (d_.quantized) {
      position.types = {kFloat, kByte, kUnsignedByte, kShort, kUnsignedShort};
      target.types = {kFloat, kByte, kShort};
      position.may_be_normalized = {kByte, kUnsignedByte, kShort, kUnsignedShort};
      target.may_be_normalized = {kByte, kShort};
    }
    check_use(primitive.position, position);
    check_use(primitive.indices,
              {where + ": indices", 1, {kUnsignedByte, kUnsignedShort, kUnsignedInt}});
    check_draco(primitive, where);
    if (primitive.indices >= 0) check_tight(primitive.indices, where + ": indices");
    const uint64_t vertices = at(d_.accessors, primitive.position).count;
    for (int t : primitive.targets) {
      check_use(t, target);
      check_count(t, vertices, target.where);
    }
    check_joint_sets(primitive, vertices, where);
    check_weights(weights, primitive, where);
    warn_of_leftovers(primitive, where);
  }

  void check_joint_sets(const Primitive& primitive, uint64_t vertices,
                        const std::string& where) const {
    for (const JointSet& set : primitive.joint_sets) {
      if (set.joints < 0 || set.weights < 0) fail(where, "has JOINTS_n without WEIGHTS_n of its n");
      check_use(set.joints, {where + ": JOINTS", 4, {kUnsignedByte, kUnsignedShort}});
      check_use(set.weights, {where + ": WEIGHTS",
                              4,
                              {kFloat, kUnsignedByte, kUnsignedShort},
                              {kUnsignedByte, kUnsignedShort}});
      check_count(set.joints, vertices, where + ": JOINTS");
      check_count(set.weights, vertices, where + ": WEIGHTS");
    }
  }

  // The accessors of a compressed primitive may have no bytes of their own.
  void check_draco(const Primitive& primitive, const std::string& where) const {
    if (!primitive.draco) return;
    for (int accessor : {primitive.position, primitive.indices})
      if (accessor >= 0 && at(d_.accessors, accessor).view < 0)
        fail(where,
             "is only there compressed by KHR_draco_mesh_compression, which voxdag does "
             "not read");
  }

  void check_weights(const std::vector<double>& weights, const Primitive& primitive,
                     const std::string& where) const {
    if (!weights.empty() && weights.size() != primitive.targets.size())
      fail(where, std::to_string(weights.size()) + " morph weights for " +
                      std::to_string(primitive.targets.size()) + " targets");
  }

  void warn_of_leftovers(const Primitive& primitive, const std::string& where) {
    if (primitive.mode != 4) return;
    const int source = primitive.indices >= 0 ? primitive.indices : primitive.position;
    if (at(d_.accessors, source).count % 3 == 0) return;
    d_.warnings.push_back(d_.path + ": " + where + ": " + d_.name_accessor(source) +
                          " is no multiple of three, the corners left over are ignored");
  }

  // How an accessor is used: the type it must have.
  struct Use {
    std::string where;
    int components;
    std::vector<int> types;
    std::vector<int> may_be_normalized = {};
  };

  void check_use(int index, const Use& use) const {
    if (index < 0) return;
    check_index(d_.accessors, index, use.where, "accessor");
    const Accessor& accessor = at(d_.accessors, index);
    const std::string where = use.where + ": " + d_.name_accessor(index);
    if (accessor.components != use.components)
      fail(where, "has " + std::to_string(accessor.components) + " components, expected " +
                      std::to_string(use.components));
    if (std::ranges::find(use.types, accessor.component_type) == use.types.end())
      fail(where,
           std::string("its component type ") + component_name(accessor.component_type) +
               " is not allowed here" +
               (use.components == 3 && !d_.quantized ? " without KHR_mesh_quantization" : ""));
    if (accessor.normalized && std::ranges::find(use.may_be_normalized, accessor.component_type) ==
                                   use.may_be_normalized.end())
      fail(where, std::string(component_name(accessor.component_type)) +
                      " components must not be normalized here");
    check_extent(accessor, where);
  }

  void check_count(int accessor, uint64_t vertices, const std::string& where) const {
    if (accessor >= 0 && at(d_.accessors, accessor).count != vertices)
      fail(where + ": " + d_.name_accessor(accessor),
           "has " + std::to_string(at(d_.accessors, accessor).count) + " elements for " +
               std::to_string(vertices) + " vertices");
  }

  void check_tight(int accessor, const std::string& where) const {
    const int view = at(d_.accessors, accessor).view;
    if (view >= 0 && at(d_.views, view).byte_stride != 0)
      fail(where + ": " + d_.name_accessor(accessor), "its bufferView has a byteStride");
  }

  void check_extent(const Accessor& accessor, const std::string& where) const {
    if (accessor.count > kMostElements)
      throw Error(ErrorCode::kLimit, d_.path + ": " + where + ": " +
                                         std::to_string(accessor.count) +
                                         " elements, the limit is 2^32");
    const uint64_t element = element_bytes(accessor);
    if (accessor.view >= 0)
      check_span(accessor.view, accessor.byte_offset, accessor.count, element, true, where);
    if (!accessor.is_sparse) return;
    const Sparse& sparse = accessor.sparse;
    if (sparse.count > accessor.count) fail(where, "has more sparse elements than elements");
    if (sparse.index_type != kUnsignedByte && sparse.index_type != kUnsignedShort &&
        sparse.index_type != kUnsignedInt)
      fail(where, "its sparse indices are no unsigned integers");
    const auto index_bytes = static_cast<uint64_t>(component_bytes(sparse.index_type));
    check_span(sparse.index_view, sparse.index_offset, sparse.count, index_bytes, false,
               where + ": sparse indices");
    check_span(sparse.value_view, sparse.value_offset, sparse.count, element, false,
               where + ": sparse values");
  }

  // `n` elements from `offset` of the view on lie inside it.
  void check_span(int view_index, uint64_t offset, uint64_t n, uint64_t element, bool strided,
                  const std::string& where) const {
    check_index(d_.views, view_index, where, "bufferView");
    const BufferView& view = at(d_.views, view_index);
    check_view(view, where + ": bufferView " + std::to_string(view_index));
    const bool has_stride = strided && view.byte_stride != 0;
    if (has_stride && view.byte_stride < element)
      fail(where, "its byteStride of " + std::to_string(view.byte_stride) +
                      " is less than an element of " + std::to_string(element) + " bytes");
    if (n == 0) return;
    const uint64_t stride = has_stride ? view.byte_stride : element;
    const uint128 end = static_cast<uint128>(n - 1) * stride + offset + element;
    if (end > view.byte_length)
      fail(where, "ends past the " + std::to_string(view.byte_length) + " bytes of bufferView " +
                      std::to_string(view_index));
  }

  void check_view(const BufferView& view, const std::string& where) const {
    check_index(d_.buffers, view.buffer, where, "buffer");
    const Buffer& buffer = at(d_.buffers, view.buffer);
    const uint128 end = static_cast<uint128>(view.byte_offset) + view.byte_length;
    if (end > buffer.byte_length)
      fail(where, "ends past the " + std::to_string(buffer.byte_length) + " bytes of buffer " +
                      std::to_string(view.buffer));
    if (buffer.source == Buffer::Source::kNone)
      fail(where, "buffer " + std::to_string(view.buffer) + " has no uri and is not in the file");
  }

  Document& d_;
};

}  // namespace

void check_document(Document& document) { Checker(document).check_all(); }

}  // namespace voxdag::gltf
