#include "scene/gltf/document/read_elements.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "core/fields/json_text.h"
#include "scene/gltf/uri/data_uri.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

int index_or_none(const JsonElement& object, const char* key) {
  const auto member = object.find(key);
  return member ? member->as_index() : -1;
}

// Returns the index of a primitive's material, or kBrokenMaterial for a value that is not an index.
// Such a value is no error, because it does not affect the geometry.
int material_index(const JsonElement& element) {
  const auto number = element.whole_number();
  return number && *number <= INT32_MAX ? static_cast<int>(*number) : Primitive::kBrokenMaterial;
}

uint64_t size_or_zero(const JsonElement& object, const char* key) {
  const auto member = object.find(key);
  return member ? member->as_size() : 0;
}

std::string name_of(const JsonElement& object) {
  const auto name = object.find("name");
  return name ? name->as_string() : "";
}

std::vector<int> indices(const JsonElement& array) {
  std::vector<int> all;
  all.reserve(array.value().size());
  array.for_each_element([&](const JsonElement& e) { all.push_back(e.as_index()); });
  return all;
}

std::vector<double> numbers(const JsonElement& object, const char* key) {
  std::vector<double> all;
  if (const auto member = object.find(key)) {
    all.reserve(member->value().size());
    member->for_each_element([&](const JsonElement& e) { all.push_back(e.as_number()); });
  }
  return all;
}

int component_type(const JsonElement& member) {
  const auto number = member.whole_number();
  if (!number || *number > INT32_MAX || component_bytes(static_cast<int>(*number)) == 0)
    member.violate("a component type (5120 to 5123, 5125 or 5126)");
  return static_cast<int>(*number);
}

int component_count(const JsonElement& type) {
  static constexpr std::pair<std::string_view, int> kTypes[] = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
  const std::string& name = type.as_string();
  for (const auto& [known, count] : kTypes)
    if (name == known) return count;
  throw Violation{type.path() + " is " + printable(name) +
                  ", expected SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4"};
}

Sparse read_sparse(const JsonElement& element) {
  const JsonElement indices = element.at("indices");
  const JsonElement values = element.at("values");
  return {static_cast<uint64_t>(element.at("count").as_index()),
          indices.at("bufferView").as_index(),
          size_or_zero(indices, "byteOffset"),
          component_type(indices.at("componentType")),
          values.at("bufferView").as_index(),
          size_or_zero(values, "byteOffset")};
}

Primitive read_primitive(const JsonElement& element) {
  Primitive out;
  const JsonElement attributes = element.at("attributes");
  attributes.for_each_member([](const JsonElement& accessor) { accessor.as_index(); });
  out.position = index_or_none(attributes, "POSITION");
  out.indices = index_or_none(element, "indices");
  if (const auto mode = element.find("mode")) out.mode = mode->as_index();
  if (const auto material = element.find("material")) out.material = material_index(*material);
  out.color = index_or_none(attributes, "COLOR_0");
  for (size_t n = 0;; ++n) {
    const int set = index_or_none(attributes, ("TEXCOORD_" + std::to_string(n)).c_str());
    if (set < 0) break;
    out.texture_coordinates.push_back(set);
  }
  for (size_t n = 0;; ++n) {
    const JointSet set{index_or_none(attributes, ("JOINTS_" + std::to_string(n)).c_str()),
                       index_or_none(attributes, ("WEIGHTS_" + std::to_string(n)).c_str())};
    if (set.joints < 0 && set.weights < 0) break;
    out.joint_sets.push_back(set);
  }
  if (const auto targets = element.find("targets")) {
    targets->for_each_element([&](const JsonElement& target) {
      target.for_each_member([](const JsonElement& accessor) { accessor.as_index(); });
      out.targets.push_back(index_or_none(target, "POSITION"));
    });
  }
  if (const auto extensions = element.find("extensions")) {
    if (const auto draco = extensions->find("KHR_draco_mesh_compression"))
      out.draco = read_draco(*draco);
  }
  return out;
}

template <size_t N>
std::array<double, N> numbers_or(const std::vector<double>& given, std::array<double, N> absent,
                                 const std::string& where, const char* what) {
  if (given.empty()) return absent;
  if (given.size() != N)
    throw Violation{where + ": its " + what + " has " + std::to_string(given.size()) +
                    " numbers, expected " + std::to_string(N)};
  std::copy(given.begin(), given.end(), absent.begin());
  return absent;
}

// True if the quaternion has nearly unit length. Any other quaternion is not a rotation, and
// readers of glTF interpret it differently.
bool is_unit(const std::vector<double>& q) {
  const double norm = ((q[0] * q[0] + q[1] * q[1]) + q[2] * q[2]) + q[3] * q[3];
  return norm > 0.99 && norm < 1.01;
}

Transform read_transform(const JsonElement& node, const std::string& where, Document& document) {
  Transform local;
  const std::vector<double> matrix = numbers(node, "matrix");
  const std::vector<double> rotation = numbers(node, "rotation");
  const std::vector<double> translation = numbers(node, "translation");
  const std::vector<double> scale = numbers(node, "scale");
  if (!matrix.empty()) {
    if (!from_columns(numbers_or<16>(matrix, {}, where, "matrix").data(), local))
      throw Violation{where + ": its matrix is not affine, expected 0 0 0 1 as the last row"};
  } else {
    local = from_trs(numbers_or<3>(translation, {0, 0, 0}, where, "translation"),
                     numbers_or<4>(rotation, {0, 0, 0, 1}, where, "rotation"),
                     numbers_or<3>(scale, {1, 1, 1}, where, "scale"));
  }
  if (!is_finite(local))
    throw Violation{where + ": its transform is not finite, expected finite numbers"};
  if (rotation.size() == 4 && !is_unit(rotation))
    document.warn("unnormalized-rotation", where,
                  "its rotation is not a unit quaternion, and is used unchanged");
  return local;
}

bool is_hidden(const JsonElement& node) {
  const auto extensions = node.find("extensions");
  const auto extension = extensions ? extensions->find("KHR_node_visibility") : std::nullopt;
  const auto visible = extension ? extension->find("visible") : std::nullopt;
  return visible && !visible->as_boolean();
}

Instancing read_instancing(const JsonElement& node) {
  const auto extensions = node.find("extensions");
  if (!extensions) return {};
  const auto extension = extensions->find("EXT_mesh_gpu_instancing");
  if (!extension) return {};
  const JsonElement attributes = extension->at("attributes");
  attributes.for_each_member([](const JsonElement& accessor) { accessor.as_index(); });
  return {true, index_or_none(attributes, "TRANSLATION"), index_or_none(attributes, "ROTATION"),
          index_or_none(attributes, "SCALE")};
}

// Returns the text of a data: URI, without JSON escapes.
std::string unescape(const ReadableFile& file, const RawString& uri) {
  std::string quoted(static_cast<size_t>(uri.characters.size) + 2, '"');
  file.read_at(uri.characters.begin - 1, std::as_writable_bytes(std::span(quoted)));
  return uri.is_escaped ? parse_json<JsonElement::Json>(quoted).get<std::string>()
                        : quoted.substr(1, quoted.size() - 2);
}

// True if the data contain escapes, blanks or other characters that are not base64. Then the
// position of a character does not give the position of its byte, so all characters must be decoded
// together.
bool is_irregular(const ReadableFile& file, FileRange base64, const RawString& uri) {
  if (uri.is_escaped) return true;
  std::array<char, size_t{16} << 10> window;
  for (uint64_t at = 0; at < base64.size; at += window.size()) {
    const auto n = static_cast<size_t>(std::min<uint64_t>(window.size(), base64.size - at));
    file.read_at(base64.begin + at, std::as_writable_bytes(std::span(window).first(n)));
    if (has_unusual_base64(std::span(window).first(n))) return true;
  }
  return false;
}

// Sets the contents of a buffer from its data: URI.
void read_data_uri(const JsonElement& member, const RawString& uri, const ReadableFile& file,
                   MemoryBudget& budget, BufferSource& out) {
  const auto parsed = parse_data_uri(member.as_string());
  if (!parsed) throw Violation{member.path() + " is a data: URI without data, expected a comma"};
  out.is_base64 = parsed->is_base64;
  out.range = {uri.characters.begin + parsed->begin, uri.characters.size - parsed->begin};
  if (parsed->is_base64 && !is_irregular(file, out.range, uri)) {
    out.kind = BufferSource::Kind::kBase64;
    return;
  }
  // Number of copies of the text in memory: the quoted text, the parser's copies, which grow by
  // doubling, and the decoded bytes.
  constexpr uint64_t kCopies = 6;
  const MemoryCharge charge(budget, kCopies * uri.characters.size,
                            "a data: URI with escapes or blanks in " + file.path());
  auto bytes =
      decode_data(std::string_view(unescape(file, uri)).substr(parsed->begin), parsed->is_base64);
  if (!bytes) throw Violation{member.path() + " has a character that is not base64"};
  out.kind = BufferSource::Kind::kMemory;
  out.range = uri.characters;
  out.bytes = std::move(*bytes);
}

template <class T>
uint64_t bytes_of(const std::vector<T>& v) {
  return v.capacity() * sizeof(T);
}

}  // namespace

Asset read_asset(const JsonElement& element) {
  Asset asset;
  asset.version = element.at("version").as_string();
  if (const auto minimum = element.find("minVersion")) asset.min_version = minimum->as_string();
  return asset;
}

std::string read_string(const JsonElement& element) { return element.as_string(); }

BufferSource read_buffer(const JsonElement& element, const ReadableFile& scene_file,
                         MemoryBudget& budget) {
  BufferSource out;
  out.byte_length = element.at("byteLength").as_size();
  if (const auto extensions = element.find("extensions"))
    if (const auto meshopt = find_meshopt(*extensions))
      if (const auto fallback = meshopt->first.find("fallback"))
        out.is_fallback = fallback->as_boolean();
  const auto member = element.find("uri");
  if (!member) return out;
  const std::string& text = member->as_string();
  const RawString& uri = element.uri();
  if (is_data_uri(text)) {
    read_data_uri(*member, uri, scene_file, budget, out);
  } else {
    if (uri.is_clipped)
      throw Violation{member->path() + " is longer than any file name, expected a relative path"};
    out.kind = BufferSource::Kind::kExternal;
    out.uri = text;
  }
  return out;
}

BufferView read_view(const JsonElement& element) {
  BufferView out;
  out.buffer = element.at("buffer").as_index();
  out.byte_offset = size_or_zero(element, "byteOffset");
  out.byte_length = element.at("byteLength").as_size();
  out.byte_stride = size_or_zero(element, "byteStride");
  if (const auto extensions = element.find("extensions")) out.meshopt = read_meshopt(*extensions);
  return out;
}

Accessor read_accessor(const JsonElement& element) {
  Accessor out;
  out.name = name_of(element);
  out.view = index_or_none(element, "bufferView");
  out.byte_offset = size_or_zero(element, "byteOffset");
  out.count = element.at("count").as_size();
  out.component_type = component_type(element.at("componentType"));
  out.components = component_count(element.at("type"));
  if (const auto normalized = element.find("normalized")) out.normalized = normalized->as_boolean();
  if (const auto sparse = element.find("sparse")) {
    out.is_sparse = true;
    out.sparse = read_sparse(*sparse);
  }
  return out;
}

Mesh read_mesh(const JsonElement& element) {
  Mesh out;
  out.name = name_of(element);
  const JsonElement primitives = element.at("primitives");
  out.primitives.reserve(primitives.value().size());
  primitives.for_each_element(
      [&](const JsonElement& primitive) { out.primitives.push_back(read_primitive(primitive)); });
  out.weights = numbers(element, "weights");
  return out;
}

Skin read_skin(const JsonElement& element) {
  return {name_of(element), indices(element.at("joints")),
          index_or_none(element, "inverseBindMatrices")};
}

Node read_node(const JsonElement& element, int index, Document& document) {
  Node out;
  out.name = name_of(element);
  out.local = read_transform(element, "node " + numbered(index, out.name), document);
  if (const auto children = element.find("children")) out.children = indices(*children);
  out.weights = numbers(element, "weights");
  out.mesh = index_or_none(element, "mesh");
  out.skin = index_or_none(element, "skin");
  out.is_hidden = is_hidden(element);
  out.instancing = read_instancing(element);
  return out;
}

std::vector<int> read_scene(const JsonElement& element) {
  const auto nodes = element.find("nodes");
  return nodes ? indices(*nodes) : std::vector<int>();
}

uint64_t heap_bytes(const Accessor& accessor) { return accessor.name.capacity(); }
uint64_t heap_bytes(const Mesh& mesh) {
  uint64_t bytes = mesh.name.capacity() + bytes_of(mesh.primitives) + bytes_of(mesh.weights);
  for (const Primitive& p : mesh.primitives)
    bytes += bytes_of(p.targets) + bytes_of(p.joint_sets) + bytes_of(p.texture_coordinates) +
             (p.draco ? heap_bytes(*p.draco) : 0);
  return bytes;
}
uint64_t heap_bytes(const Skin& skin) { return skin.name.capacity() + bytes_of(skin.joints); }
uint64_t heap_bytes(const Node& node) {
  return node.name.capacity() + bytes_of(node.children) + bytes_of(node.weights);
}
uint64_t heap_bytes(const std::vector<int>& nodes) { return bytes_of(nodes); }

}  // namespace voxdag::gltf
