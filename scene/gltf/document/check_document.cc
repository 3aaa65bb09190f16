#include "scene/gltf/document/check_document.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "scene/gltf/document/check_meshes.h"
#include "scene/gltf/document/scene_nodes.h"
#include "scene/gltf/json/array_access.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

// Maximum number of elements of an accessor. Indices have 32 bits, so a primitive cannot use more
// vertices than this. The limit also bounds accessors without bytes (all zeros), which could claim
// any count.
constexpr uint64_t kMaxElements = uint64_t{1} << 32;

// The position of an array in a buffer view: `count` elements of `bytes` bytes each. The first
// element begins at byte `offset` of the view.
struct Extent {
  int view;
  uint64_t offset;
  uint64_t count;
  uint64_t bytes;
};

std::string text_of(uint128 bytes) {
  return bytes > UINT64_MAX ? "2^64" : std::to_string(static_cast<uint64_t>(bytes));
}

void check_view(const Document& d, const BufferView& view, const std::string& where) {
  check_index(d, d.buffers.size(), view.buffer, where, "buffer");
  d.check_usable("buffers", view.buffer);
  const BufferSource& buffer = at(d.buffers, view.buffer);
  const std::string name = "buffer " + std::to_string(view.buffer);
  if (buffer.kind == BufferSource::Kind::kDecoded) check_compressed(d, view, where);
  const uint128 end = static_cast<uint128>(view.byte_offset) + view.byte_length;
  if (end > buffer.byte_length)
    refuse(d.path, where + ": " + name + " has " + std::to_string(buffer.byte_length) +
                       " bytes, expected at least " + text_of(end));
  if (buffer.kind == BufferSource::Kind::kNone)
    refuse(
        d.path,
        where + ": " + name +
            " has no uri and is not in the file, expected a uri, or a GLB file with the chunk BIN");
}

void check_extent(const Document& d, const Extent& extent, const std::string& where) {
  check_index(d, d.views.size(), extent.view, where, "bufferView");
  d.check_usable("bufferViews", extent.view);
  const BufferView& view = d.views[static_cast<size_t>(extent.view)];
  const std::string name = "bufferView " + std::to_string(extent.view);
  check_view(d, view, where + ": " + name);
  if (view.byte_stride != 0 && view.byte_stride < extent.bytes)
    refuse(d.path, where + ": the byteStride of " + name + " is " +
                       std::to_string(view.byte_stride) + ", expected at least " +
                       std::to_string(extent.bytes) + ", the bytes of an element");
  if (extent.count == 0) return;
  const uint64_t stride = view.byte_stride != 0 ? view.byte_stride : extent.bytes;
  const uint128 end =
      static_cast<uint128>(extent.count - 1) * stride + extent.offset + extent.bytes;
  if (end > view.byte_length)
    refuse(d.path, where + ": " + name + " has " + std::to_string(view.byte_length) +
                       " bytes, expected at least " + text_of(end));
}

void check_sparse(const Document& d, const Accessor& accessor, const std::string& where) {
  const Sparse& sparse = accessor.sparse;
  if (sparse.count > accessor.count)
    refuse(d.path, where + " has " + std::to_string(sparse.count) +
                       " sparse replacements, expected at most " + std::to_string(accessor.count) +
                       ", the number of its elements");
  if (sparse.index_type != kUnsignedByte && sparse.index_type != kUnsignedShort &&
      sparse.index_type != kUnsignedInt)
    refuse(d.path, where +
                       ": its sparse indices are not unsigned integers, but of the component "
                       "type " +
                       std::to_string(sparse.index_type) + ", expected 5121, 5123 or 5125");
  const auto index_bytes = static_cast<uint64_t>(component_bytes(sparse.index_type));
  check_extent(d, {sparse.index_view, sparse.index_offset, sparse.count, index_bytes},
               where + ": its sparse indices");
  check_extent(d, {sparse.value_view, sparse.value_offset, sparse.count, element_bytes(accessor)},
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
  d.check_usable("accessors", index);
  const Accessor& accessor = d.accessors[static_cast<size_t>(index)];
  const std::string where = use.where + ": " + d.name_accessor(index);
  check_type(d, accessor, use, where);
  if (accessor.count > kMaxElements)
    throw Error(ErrorCode::kLimit, d.path + ": " + where + " has " +
                                       std::to_string(accessor.count) +
                                       " elements, the limit is 2^32");
  if (accessor.view >= 0)
    check_extent(d, {accessor.view, accessor.byte_offset, accessor.count, element_bytes(accessor)},
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
  link_scene(d);
  place_meshopt_views(d);
  check_drawn_meshes(d);
  for (const auto& [element, message] : d.broken)
    d.warn("broken-element", "", message + "; the geometry does not use it");
}

}  // namespace voxdag::gltf
