#include "scene/gltf/document/check_document.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "scene/gltf/document/check_meshes.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

template <class Array>
const auto& at(const Array& a, int i) {
  return a[static_cast<size_t>(i)];
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

void check_index(const Document& d, size_t size, int index, const std::string& where,
                 const char* what) {
  if (index < 0 || static_cast<size_t>(index) >= size)
    refuse(d.path, where + ": " + what + " " + std::to_string(index) +
                       " does not exist, there are " + std::to_string(size));
}

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

void check_document(Document& d) {
  link_parents(d);
  choose_scene(d);
  place_meshopt_views(d);
  check_drawn_meshes(d);
}

}  // namespace voxdag::gltf
