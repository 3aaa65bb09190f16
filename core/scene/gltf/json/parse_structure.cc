// The one place that includes tiny_gltf.h.
#include <tiny_gltf.h>

#include <array>
#include <exception>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/scene/gltf/document/read_document.h"

namespace voxdag::gltf {
namespace {

// What tinygltf and its JSON tree hold at their peak; measured over slices of nodes, meshes or
// accessors, for which the sum is 1.0 to 1.9 times the truth.
constexpr uint64_t kBytesPerObject = 896;
constexpr uint64_t kBytesPerValue = 64;
constexpr uint64_t kBytesPerCharacter = 3;

constexpr size_t kLongestReason = 300;

tinygltf::Model load(const JsonSlice& slice, const std::string& path) {
  // tinygltf takes no text of less than four characters, and "{}" is one.
  const std::string text = slice.text + "  ";
  tinygltf::TinyGLTF parser;
  tinygltf::Model model;
  std::string errors, warnings;
  bool loaded = false;
  try {
    loaded =
        parser.LoadASCIIFromString(&model, &errors, &warnings, text.data(),
                                   static_cast<unsigned>(text.size()), "", tinygltf::NO_REQUIRE);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: the system has no room for the JSON of " + path);
  } catch (const std::exception& e) {
    refuse(path, e.what());
  }
  while (!errors.empty() && errors.back() == '\n') errors.pop_back();
  if (!loaded) refuse(path, errors.empty() ? "is no glTF 2.0" : errors.substr(0, kLongestReason));
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
    document.warn("node " + numbered(index, n.name) +
                  ": its rotation is no unit quaternion, taken as given");
  out.name = std::move(n.name);
  out.children = std::move(n.children);
  out.weights = std::move(n.weights);
  out.mesh = n.mesh;
  out.skin = n.skin;
  out.instancing = convert_instancing(n);
  return out;
}

// Makes room for all elements at once: there are that many in the file, and growing step by step
// would hold them twice. Names and children take no more than two bytes for one of text.
MemoryCharge reserve(const FilteredJson& json, MemoryBudget& budget, Document& document) {
  const auto count = [&](const char* section) {
    const auto found = json.element_counts.find(section);
    return found == json.element_counts.end() ? size_t{0} : static_cast<size_t>(found->second);
  };
  uint64_t bytes = 0;
  for (const JsonSlice& slice : json.slices.all()) bytes += 2 * slice.text.size();
  bytes += count("bufferViews") * sizeof(BufferView) + count("accessors") * sizeof(Accessor) +
           count("meshes") * sizeof(Mesh) + count("skins") * sizeof(Skin) +
           count("nodes") * sizeof(Node);
  MemoryCharge charge(budget, bytes, "the structure of " + document.path);
  document.views.reserve(count("bufferViews"));
  document.accessors.reserve(count("accessors"));
  document.meshes.reserve(count("meshes"));
  document.skins.reserve(count("skins"));
  document.nodes.reserve(count("nodes"));
  return charge;
}

// Appends the elements of a slice to those of the slices before it.
void append(tinygltf::Model model, Document& document) {
  for (const auto& v : model.bufferViews) document.views.push_back(convert(v));
  for (auto& a : model.accessors) document.accessors.push_back(convert(a));
  for (auto& m : model.meshes) document.meshes.push_back(convert(m));
  for (auto& s : model.skins) document.skins.push_back(convert(s));
  for (auto& n : model.nodes)
    document.nodes.push_back(convert(n, static_cast<int>(document.nodes.size()), document));
  for (auto& s : model.scenes) document.scenes.push_back(std::move(s.nodes));
  if (model.defaultScene >= 0) document.scene = model.defaultScene;
}

void set_indices(const std::vector<PrimitiveIndices>& all, Document& document) {
  for (const PrimitiveIndices& i : all) {
    if (i.mesh >= document.meshes.size() ||
        i.primitive >= document.meshes[i.mesh].primitives.size())
      refuse(document.path, "mesh " + std::to_string(i.mesh) + " was not parsed whole");
    document.meshes[i.mesh].primitives[i.primitive].indices = i.accessor;
  }
}

}  // namespace

void parse_structure(const FilteredJson& json, MemoryBudget& budget, const CancelToken& cancel,
                     Document& document) {
  MemoryCharge reserved = reserve(json, budget, document);
  for (const JsonSlice& slice : json.slices.all()) {
    cancel.check();
    const uint64_t bytes = slice.object_count * kBytesPerObject +
                           slice.value_count * kBytesPerValue +
                           slice.text.size() * kBytesPerCharacter;
    const MemoryCharge parsing(budget, bytes, "the structure of " + document.path);
    append(load(slice, document.path), document);
  }
  set_indices(json.indices, document);
  reserved.try_resize(document.memory_bytes());
  document.charge = std::move(reserved);
  trim_heap();  // many small blocks were freed
}

}  // namespace voxdag::gltf
