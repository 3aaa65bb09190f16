#include "scene/gltf/document/document.h"

#include <algorithm>

#include "scene/gltf/document/strip_restarts.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

struct ComponentInfo {
  const char* name;
  int bytes;
};

ComponentInfo component_info(int component_type) {
  static constexpr ComponentInfo kInfos[] = {
      {"byte", 1},    {"unsigned byte", 1}, {"short", 2}, {"unsigned short", 2},
      {"unknown", 0}, {"unsigned int", 4},  {"float", 4}};
  return component_type >= kByte && component_type <= kFloat ? kInfos[component_type - kByte]
                                                             : ComponentInfo{"unknown", 0};
}

template <class T>
std::string name_of(const char* kind, const std::deque<T>& all, int index) {
  const size_t i = static_cast<size_t>(index);
  return kind +
         (index >= 0 && i < all.size() ? numbered(index, all[i].name) : std::to_string(index));
}

}  // namespace

void Document::warn(const char* code, const std::string& place, const std::string& message,
                    uint64_t count) {
  warnings.add({code, place.empty() ? path : path + ": " + place, message, count});
}

void Document::add_broken(std::string_view section, int index, const std::string& message) {
  constexpr uint64_t kMapBytes = 96;
  charge.add(kMapBytes + sizeof(message) + message.size());
  broken.emplace(std::pair(std::string(section), index), message);
}

void Document::check_usable(const char* section, int index) const {
  if (broken.empty()) return;
  const auto found = broken.find({section, index});
  if (found != broken.end()) refuse(path, found->second);
}

std::string Document::name_node(int node) const { return name_of("node ", nodes, node); }
std::string Document::name_mesh(int mesh) const { return name_of("mesh ", meshes, mesh); }
std::string Document::name_skin(int skin) const { return name_of("skin ", skins, skin); }
std::string Document::name_accessor(int accessor) const {
  const bool is_copy = accessor >= 0 && static_cast<size_t>(accessor) < accessors.size() &&
                       accessors[static_cast<size_t>(accessor)].same_as >= 0;
  return name_of("accessor ", accessors,
                 is_copy ? accessors[static_cast<size_t>(accessor)].same_as : accessor);
}

int component_bytes(int component_type) { return component_info(component_type).bytes; }
const char* component_name(int component_type) { return component_info(component_type).name; }

uint64_t triangle_count(const Document& document, const Primitive& primitive) {
  if (!primitive.makes_triangles()) return 0;
  if (primitive.restarts) return primitive.restarts->triangles;
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
