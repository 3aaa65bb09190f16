#include "core/scene/gltf/document/document.h"

#include <algorithm>

#include "core/scene/gltf/messages.h"

namespace voxdag::gltf {
namespace {

constexpr size_t kMaxWarnings = 20;

template <class T>
std::string name_of(const char* kind, const std::deque<T>& all, int index) {
  const size_t i = static_cast<size_t>(index);
  return kind +
         (index >= 0 && i < all.size() ? numbered(index, all[i].name) : std::to_string(index));
}

}  // namespace

void Document::warn(const std::string& what) {
  if (warnings.size() < kMaxWarnings)
    warnings.push_back(path + ": " + what);
  else
    ++further_warnings;
}

std::string Document::name_node(int node) const { return name_of("node ", nodes, node); }
std::string Document::name_mesh(int mesh) const { return name_of("mesh ", meshes, mesh); }
std::string Document::name_skin(int skin) const { return name_of("skin ", skins, skin); }
std::string Document::name_accessor(int accessor) const {
  return name_of("accessor ", accessors, accessor);
}

int component_bytes(int component_type) {
  switch (component_type) {
    case kByte:
    case kUnsignedByte:
      return 1;
    case kShort:
    case kUnsignedShort:
      return 2;
    case kUnsignedInt:
    case kFloat:
      return 4;
    default:
      return 0;
  }
}

const char* component_name(int component_type) {
  switch (component_type) {
    case kByte:
      return "byte";
    case kUnsignedByte:
      return "unsigned byte";
    case kShort:
      return "short";
    case kUnsignedShort:
      return "unsigned short";
    case kUnsignedInt:
      return "unsigned int";
    case kFloat:
      return "float";
    default:
      return "unknown";
  }
}

uint64_t triangle_count(const Document& document, const Primitive& primitive) {
  if (!primitive.makes_triangles()) return 0;
  const int source = primitive.indices >= 0 ? primitive.indices : primitive.position;
  const uint64_t corners = document.accessors[static_cast<size_t>(source)].count;
  if (primitive.mode == kTriangleList) return corners / 3;
  return corners < 3 ? 0 : corners - 2;
}

uint64_t instance_count(const Document& document, const Node& node) {
  if (!node.instancing.present) return 1;
  const Instancing& i = node.instancing;
  const int source = std::max({i.translation, i.rotation, i.scale});
  return source < 0 ? 1 : document.accessors[static_cast<size_t>(source)].count;
}

}  // namespace voxdag::gltf
