// The one place that includes tiny_gltf.h.
#include <malloc.h>
#include <tiny_gltf.h>

#include <array>
#include <exception>

#include "core/base/error.h"
#include "core/scene/gltf/read_document.h"

namespace voxdag::gltf {
namespace {

// What tinygltf, its JSON tree and our structs hold together at their peak; measured over scenes of
// 300 000 nodes, meshes or accessors, for which the sum is 1.0 to 1.9 times the truth.
constexpr uint64_t kBytesPerObject = 896;
constexpr uint64_t kBytesPerValue = 64;
constexpr uint64_t kBytesPerCharacter = 3;

constexpr uint64_t kLongestText = UINT32_MAX;

tinygltf::Model load(const FilteredJson& json, const std::string& path) {
  if (json.text.size() > kLongestText)
    throw Error(ErrorCode::kLimit, path + ": its JSON is over 4 GiB, the limit of the parser");
  tinygltf::TinyGLTF parser;
  tinygltf::Model model;
  std::string errors, warnings;
  bool loaded = false;
  try {
    loaded = parser.LoadASCIIFromString(&model, &errors, &warnings, json.text.data(),
                                        static_cast<unsigned>(json.text.size()), "",
                                        tinygltf::NO_REQUIRE);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: the system has no room for the JSON of " + path);
  } catch (const std::exception& e) {
    refuse(path, e.what());
  }
  while (!errors.empty() && errors.back() == '\n') errors.pop_back();
  if (!loaded) refuse(path, errors.empty() ? "is no valid glTF 2.0" : errors.substr(0, 300));
  return model;
}

BufferView convert(const tinygltf::BufferView& v) {
  return {v.buffer, v.byteOffset, v.byteLength, v.byteStride};
}

Accessor convert(tinygltf::Accessor& a) {
  Accessor out;
  out.name = std::move(a.name);
  out.view = a.bufferView;
  out.byte_offset = a.byteOffset;
  out.count = a.count;
  out.component_type = a.componentType;
  out.components = tinygltf::GetNumComponentsInType(static_cast<uint32_t>(a.type));
  out.normalized = a.normalized;
  out.is_sparse = a.sparse.isSparse;
  if (!out.is_sparse) return out;
  const auto& s = a.sparse;
  out.sparse = {static_cast<uint64_t>(s.count),
                s.indices.bufferView,
                static_cast<uint64_t>(s.indices.byteOffset),
                s.indices.componentType,
                s.values.bufferView,
                static_cast<uint64_t>(s.values.byteOffset)};
  return out;
}

int find(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto it = attributes.find(name);
  return it == attributes.end() ? -1 : it->second;
}

Primitive convert(const tinygltf::Primitive& p) {
  Primitive out;
  out.mode = p.mode;
  out.position = find(p.attributes, "POSITION");
  out.indices = p.indices;
  out.draco = p.extensions.contains("KHR_draco_mesh_compression");
  for (const auto& target : p.targets) out.targets.push_back(find(target, "POSITION"));
  for (size_t n = 0;; ++n) {
    const JointSet set{find(p.attributes, "JOINTS_" + std::to_string(n)),
                       find(p.attributes, "WEIGHTS_" + std::to_string(n))};
    if (set.joints < 0 && set.weights < 0) break;
    out.joint_sets.push_back(set);
  }
  return out;
}

Mesh convert(tinygltf::Mesh& m) {
  Mesh out{std::move(m.name), {}, std::move(m.weights)};
  out.primitives.reserve(m.primitives.size());
  for (const tinygltf::Primitive& p : m.primitives) out.primitives.push_back(convert(p));
  return out;
}

Skin convert(tinygltf::Skin& s) {
  return {std::move(s.name), std::move(s.joints), s.inverseBindMatrices};
}

template <size_t N>
std::array<double, N> numbers(const std::vector<double>& given, std::array<double, N> absent,
                              const std::string& where, const char* what) {
  if (given.empty()) return absent;
  if (given.size() != N)
    throw Error(ErrorCode::kInvalidInput, where + ": its " + what + " has " +
                                              std::to_string(given.size()) + " numbers, expected " +
                                              std::to_string(N));
  std::copy(given.begin(), given.end(), absent.begin());
  return absent;
}

Transform local_transform(const tinygltf::Node& n, const std::string& where) {
  Transform local;
  if (!n.matrix.empty()) {
    const auto columns = numbers<16>(n.matrix, {}, where, "matrix");
    if (!from_columns(columns.data(), local))
      throw Error(ErrorCode::kInvalidInput,
                  where + ": its matrix is not affine, expected 0 0 0 1 as the last row");
  } else {
    local = from_trs(numbers<3>(n.translation, {0, 0, 0}, where, "translation"),
                     numbers<4>(n.rotation, {0, 0, 0, 1}, where, "rotation"),
                     numbers<3>(n.scale, {1, 1, 1}, where, "scale"));
  }
  if (!is_finite(local))
    throw Error(ErrorCode::kInvalidInput, where + ": its transform is not finite");
  return local;
}

Instancing convert_instancing(const tinygltf::Node& n) {
  const auto it = n.extensions.find("EXT_mesh_gpu_instancing");
  if (it == n.extensions.end()) return {};
  const tinygltf::Value& attributes = it->second.Get("attributes");
  const auto accessor = [&](const char* name) {
    return attributes.Has(name) ? attributes.Get(name).GetNumberAsInt() : -1;
  };
  return {true, accessor("TRANSLATION"), accessor("ROTATION"), accessor("SCALE")};
}

// Far from unit length, a quaternion is no rotation, and what it does is anyone's guess.
bool is_rotation(const std::vector<double>& q) {
  if (q.size() != 4) return q.empty();
  const double norm = ((q[0] * q[0] + q[1] * q[1]) + q[2] * q[2]) + q[3] * q[3];
  return norm > 0.99 && norm < 1.01;
}

Node convert(tinygltf::Node& n, int index, Document& document) {
  Node out;
  const std::string where = document.path + ": node " + numbered(index, n.name);
  out.local = local_transform(n, where);
  if (!is_rotation(n.rotation))
    document.warnings.push_back(where + ": its rotation is no unit quaternion, taken as given");
  out.name = std::move(n.name);
  out.children = std::move(n.children);
  out.weights = std::move(n.weights);
  out.mesh = n.mesh;
  out.skin = n.skin;
  out.instancing = convert_instancing(n);
  return out;
}

void convert(tinygltf::Model model, Document& document) {
  document.views.reserve(model.bufferViews.size());
  for (const auto& v : model.bufferViews) document.views.push_back(convert(v));
  document.accessors.reserve(model.accessors.size());
  for (auto& a : model.accessors) document.accessors.push_back(convert(a));
  document.meshes.reserve(model.meshes.size());
  for (auto& m : model.meshes) document.meshes.push_back(convert(m));
  document.skins.reserve(model.skins.size());
  for (auto& s : model.skins) document.skins.push_back(convert(s));
  document.nodes.reserve(model.nodes.size());
  for (auto& n : model.nodes)
    document.nodes.push_back(convert(n, static_cast<int>(document.nodes.size()), document));
  document.scenes.reserve(model.scenes.size());
  for (auto& s : model.scenes) document.scenes.push_back(std::move(s.nodes));
  document.scene = model.defaultScene;
}

}  // namespace

void parse_structure(const FilteredJson& json, MemoryBudget& budget, Document& document) {
  {
    const uint64_t bytes = json.object_count * kBytesPerObject + json.value_count * kBytesPerValue +
                           json.text.size() * kBytesPerCharacter;
    const MemoryCharge charge(budget, bytes, "the structure of " + document.path);
    convert(load(json, document.path), document);
  }
#ifdef __GLIBC__
  // A million small blocks were freed; the allocator would keep their pages.
  malloc_trim(0);
#endif
}

}  // namespace voxdag::gltf
