#include "scene/gltf/document/compression.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "core/base/error.h"
#include "core/base/integers.h"
#include "scene/gltf/document/document.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

#ifdef VOXDAG_HAS_DRACO
constexpr bool kHasDraco = true;
#else
constexpr bool kHasDraco = false;
#endif
#ifdef VOXDAG_HAS_MESHOPT
constexpr bool kHasMeshopt = true;
#else
constexpr bool kHasMeshopt = false;
#endif

int index_or(const JsonElement& object, const std::string& key) {
  const auto member = object.find(key.c_str());
  return member ? member->as_index() : -1;
}

template <class Value, size_t N>
Value named(const JsonElement& object, const char* key, const char* expected,
            const std::pair<std::string_view, Value> (&names)[N], Value absent) {
  const auto member = object.find(key);
  if (!member) return absent;
  const std::string& name = member->as_string();
  for (const auto& [known, value] : names)
    if (name == known) return value;
  throw Violation{member->path() + " is " + printable(name) + ", expected " + expected};
}

void check_layout(const MeshoptView& view, const std::string& path) {
  const auto violate = [&](const char* member, uint64_t value, const char* expected) {
    throw Violation{path + "." + member + " is " + std::to_string(value) + ", expected " +
                    expected};
  };
  const bool is_vertices = view.mode == MeshoptView::Mode::kAttributes;
  if (is_vertices && (view.stride == 0 || view.stride > 256 || view.stride % 4 != 0))
    violate("byteStride", view.stride, "a multiple of 4 from 4 to 256");
  if (!is_vertices && view.stride != 2 && view.stride != 4)
    violate("byteStride", view.stride, "2 or 4, the sizes of indices");
  if (view.mode == MeshoptView::Mode::kTriangles && view.count % 3 != 0)
    violate("count", view.count, "a multiple of three, as TRIANGLES requires");
  if (view.count > uint64_t{1} << 32) violate("count", view.count, "at most 2^32");
  using Filter = MeshoptView::Filter;
  if (view.filter == Filter::kNone) return;
  if (!is_vertices) throw Violation{path + " has a filter, expected one only for ATTRIBUTES"};
  const bool is_4_or_8 = view.stride == 4 || view.stride == 8;
  if (view.filter == Filter::kOctahedral && !is_4_or_8)
    violate("byteStride", view.stride, "4 or 8, as OCTAHEDRAL requires");
  if (view.filter == Filter::kColor && !is_4_or_8)
    violate("byteStride", view.stride, "4 or 8, as COLOR requires");
  if (view.filter == Filter::kQuaternion && view.stride != 8)
    violate("byteStride", view.stride, "8, as QUATERNION requires");
}

// Adds `buffer`, a buffer for decoded bytes, to the document, and returns its index. `heap` is the
// heap memory that `buffer` owns, in bytes.
int add_buffer(Document& d, BufferSource buffer, uint64_t heap) {
  d.charge.add(sizeof(buffer) + heap);
  d.buffers.push_back(std::move(buffer));
  return static_cast<int>(d.buffers.size()) - 1;
}

bool exists(const Document& d, int accessor) {
  return accessor >= 0 && static_cast<size_t>(accessor) < d.accessors.size() &&
         !d.broken.contains({"accessors", accessor});
}

const Accessor& at(const Document& d, int accessor) {
  return d.accessors[static_cast<size_t>(accessor)];
}

// Adds a copy of accessor `accessor`, and sets `accessor` to the index of the copy. The copy's
// `count` elements are packed and begin at byte `offset` of buffer `buffer`. Returns the number of
// bytes of these elements.
uint64_t move_accessor(Document& d, int& accessor, uint64_t count, int buffer, uint64_t offset) {
  Accessor copy = at(d, accessor);
  copy.count = count;
  if (copy.same_as < 0) copy.same_as = accessor;
  const uint64_t bytes = copy.count * element_bytes(copy);
  copy.view = static_cast<int>(d.views.size());
  copy.byte_offset = 0;
  BufferView view;
  view.buffer = buffer;
  view.byte_offset = offset;
  view.byte_length = bytes;
  d.charge.add(sizeof(copy) + copy.name.capacity() + sizeof(view));
  d.views.push_back(std::move(view));
  accessor = static_cast<int>(d.accessors.size());
  d.accessors.push_back(std::move(copy));
  return bytes;
}

// An attribute that Draco data contain: its id in these data, the primitive's accessor that must be
// changed to refer to the decoded values, and the attribute's name for messages.
struct Replaced {
  int id;
  int* accessor;
  std::string name;
};

std::vector<Replaced> replaced_attributes(const DracoExtension& draco, Primitive& primitive) {
  std::vector<Replaced> all{{draco.position, &primitive.position, "POSITION"}};
  const size_t sets = std::min(draco.joint_sets.size(), primitive.joint_sets.size());
  for (size_t n = 0; n < sets; ++n) {
    const std::string suffix = "_" + std::to_string(n);
    all.push_back({draco.joint_sets[n].joints, &primitive.joint_sets[n].joints, "JOINTS" + suffix});
    all.push_back(
        {draco.joint_sets[n].weights, &primitive.joint_sets[n].weights, "WEIGHTS" + suffix});
  }
  std::erase_if(all, [](const Replaced& r) { return r.id < 0; });
  return all;
}

CompressedBytes bytes_of_view(const Document& d, int view, const std::string& what) {
  if (static_cast<size_t>(view) >= d.views.size())
    refuse(d.path, what + ": bufferView " + std::to_string(view) + " does not exist, there are " +
                       std::to_string(d.views.size()));
  d.check_usable("bufferViews", view);
  const BufferView& v = d.views[static_cast<size_t>(view)];
  return {v.buffer, v.byte_offset, v.byte_length};
}

// Checks that the view's length and stride fit the decoded bytes.
void check_parent(const Document& d, const BufferView& view, const std::string& where) {
  const MeshoptView& meshopt = *view.meshopt;
  const std::string name = meshopt.extension;
  if (view.byte_length > meshopt.decoded_bytes())
    refuse(d.path, where + " has byteLength " + std::to_string(view.byte_length) +
                       ": expected at most " + std::to_string(meshopt.decoded_bytes()) +
                       ", the bytes that its " + name + " decodes to");
  if (view.byte_stride != 0 && view.byte_stride != meshopt.stride)
    refuse(d.path, where + " has byteStride " + std::to_string(view.byte_stride) + ": expected " +
                       std::to_string(meshopt.stride) + ", the stride of its " + name);
}

}  // namespace

uint64_t DracoPart::decoded_bytes() const {
  uint64_t bytes = has_indices ? corners * sizeof(uint32_t) : 0;
  for (const Attribute& a : attributes)
    bytes += vertices * static_cast<uint64_t>(component_bytes(a.component_type) * a.components);
  return bytes;
}

std::optional<std::pair<JsonElement, const char*>> find_meshopt(const JsonElement& extensions) {
  for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
    if (const auto extension = extensions.find(name)) return std::pair(*extension, name);
  return std::nullopt;
}

std::shared_ptr<const MeshoptView> read_meshopt(const JsonElement& extensions) {
  using ViewMode = MeshoptView::Mode;
  using Filter = MeshoptView::Filter;
  static constexpr std::pair<std::string_view, ViewMode> kModes[] = {
      {"ATTRIBUTES", ViewMode::kAttributes},
      {"TRIANGLES", ViewMode::kTriangles},
      {"INDICES", ViewMode::kIndices}};
  static constexpr std::pair<std::string_view, Filter> kFilters[] = {
      {"NONE", Filter::kNone},
      {"OCTAHEDRAL", Filter::kOctahedral},
      {"QUATERNION", Filter::kQuaternion},
      {"EXPONENTIAL", Filter::kExponential},
      {"COLOR", Filter::kColor}};
  const auto found = find_meshopt(extensions);
  if (!found) return nullptr;
  const JsonElement& extension = found->first;
  auto out = std::make_shared<MeshoptView>();
  out->extension = found->second;
  const auto offset = extension.find("byteOffset");
  out->from = {extension.at("buffer").as_index(), offset ? offset->as_size() : 0,
               extension.at("byteLength").as_size()};
  out->count = extension.at("count").as_size();
  out->stride = extension.at("byteStride").as_size();
  extension.at("mode");
  out->mode =
      named(extension, "mode", "ATTRIBUTES, TRIANGLES or INDICES", kModes, ViewMode::kIndices);
  out->filter = named(extension, "filter", "NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL or COLOR",
                      kFilters, Filter::kNone);
  check_layout(*out, extension.path());
  return out;
}

std::shared_ptr<const DracoExtension> read_draco(const JsonElement& extension) {
  auto out = std::make_shared<DracoExtension>();
  out->view = extension.at("bufferView").as_index();
  const JsonElement attributes = extension.at("attributes");
  attributes.for_each_member([](const JsonElement& id) { id.as_index(); });
  out->position = index_or(attributes, "POSITION");
  out->color = index_or(attributes, "COLOR_0");
  for (size_t n = 0;; ++n) {
    const int set = index_or(attributes, "TEXCOORD_" + std::to_string(n));
    if (set < 0) break;
    out->texture_coordinates.push_back(set);
  }
  for (size_t n = 0;; ++n) {
    const DracoExtension::JointSet set{index_or(attributes, "JOINTS_" + std::to_string(n)),
                                       index_or(attributes, "WEIGHTS_" + std::to_string(n))};
    if (set.joints < 0 && set.weights < 0) break;
    out->joint_sets.push_back(set);
  }
  return out;
}

uint64_t heap_bytes(const DracoExtension& draco) {
  return sizeof(draco) + draco.joint_sets.capacity() * sizeof(DracoExtension::JointSet) +
         draco.texture_coordinates.capacity() * sizeof(int);
}

void place_meshopt_views(Document& d) {
  const size_t own_buffers = d.buffers.size();
  for (size_t i = 0; i < d.views.size(); ++i) {
    BufferView& view = d.views[i];
    if (!view.meshopt) continue;
    const bool is_there = view.buffer >= 0 && static_cast<size_t>(view.buffer) < own_buffers;
    if (!is_there || d.buffers[static_cast<size_t>(view.buffer)].kind != BufferSource::Kind::kNone)
      continue;
    BufferSource decoded;
    decoded.kind = BufferSource::Kind::kDecoded;
    decoded.byte_length = view.meshopt->decoded_bytes();
    decoded.meshopt = view.meshopt;
    view.buffer = add_buffer(d, std::move(decoded), 0);
    view.byte_offset = 0;
  }
}

namespace {

void add_attribute(const Document& d, const Replaced& r, DracoPart& part) {
  const Accessor& accessor = at(d, *r.accessor);
  part.attributes.push_back(
      {r.id, r.name, accessor.component_type, accessor.components, accessor.normalized});
}

// Adds a buffer for the part's decoded bytes, and returns its index.
int add_part(Document& d, const std::shared_ptr<const DracoPart>& part) {
  BufferSource decoded;
  decoded.kind = BufferSource::Kind::kDecoded;
  decoded.byte_length = part->decoded_bytes();
  decoded.draco = part;
  return add_buffer(d, std::move(decoded),
                    sizeof(*part) + part->where.size() + part->attributes.size() * 96);
}

}  // namespace

void place_draco_primitive(Document& d, Primitive& primitive, const std::string& where) {
  if (!primitive.draco) return;
  const std::string what = where + ": KHR_draco_mesh_compression";
  const bool has_indices = primitive.indices >= 0;
  if (!exists(d, primitive.position) || (has_indices && !exists(d, primitive.indices)))
    return;  // a missing accessor is refused later, as in any primitive
  const bool has_fallback =
      at(d, primitive.position).view >= 0 && (!has_indices || at(d, primitive.indices).view >= 0);
  if (has_fallback) return;
  if (!has_indices)
    refuse(d.path, what + " is in a primitive without indices, expected an accessor of indices");
  if (primitive.mode == kTriangleFan)
    refuse(d.path,
           what + " is in a primitive of mode 6 (fan), expected 4 (triangles) or 5 (strip)");
  if (primitive.draco->position < 0)
    refuse(d.path, what + " has no POSITION, expected this attribute");

  auto part = std::make_shared<DracoPart>();
  part->where = where;
  part->from = bytes_of_view(d, primitive.draco->view, what);
  part->is_strip = primitive.mode == kTriangleStrip;
  const uint64_t triangles = triangle_count(d, primitive);
  part->vertices = at(d, primitive.position).count;
  if (std::max(part->vertices, triangles) > UINT32_MAX)
    throw Error(ErrorCode::kLimit, d.path + ": " + what + ": the accessors have " +
                                       std::to_string(part->vertices) + " vertices and " +
                                       std::to_string(triangles) +
                                       " triangles, expected less than 2^32 of each");
  part->corners = 3 * triangles;
  const std::vector<Replaced> replaced = replaced_attributes(*primitive.draco, primitive);
  for (const Replaced& r : replaced) {
    if (!exists(d, *r.accessor)) return;
    add_attribute(d, r, *part);
  }
  const int buffer = add_part(d, part);
  // The decoded faces are a triangle list, whatever the original mode was.
  primitive.mode = kTriangleList;
  const uint64_t corners = part->corners;
  move_accessor(d, primitive.indices, corners, buffer, 0);
  Accessor& indices = d.accessors.back();
  indices.component_type = kUnsignedInt;
  d.views.back().byte_length = corners * sizeof(uint32_t);
  uint64_t offset = corners * sizeof(uint32_t);
  for (const Replaced& r : replaced)
    offset += move_accessor(d, *r.accessor, part->vertices, buffer, offset);
}

void place_draco_surface(Document& d, Primitive& primitive, int set) {
  const int view = at(d, primitive.position).view;
  if (!primitive.draco || view < 0) return;
  const BufferView& positions = d.views[static_cast<size_t>(view)];
  const std::shared_ptr<const DracoPart> geometry =
      d.buffers[static_cast<size_t>(positions.buffer)].draco;
  if (!geometry) return;  // the fallback is read
  PrimitiveSurface& surface = primitive.surface;
  const std::vector<int>& ids = primitive.draco->texture_coordinates;
  const auto n = static_cast<size_t>(set);
  std::vector<Replaced> replaced{{primitive.draco->color, &surface.color, "COLOR_0"},
                                 {n < ids.size() ? ids[n] : -1, &surface.texture_coordinates,
                                  "TEXCOORD_" + std::to_string(set)}};
  std::erase_if(replaced, [&](const Replaced& r) { return r.id < 0 || !exists(d, *r.accessor); });
  if (replaced.empty()) return;
  auto part = std::make_shared<DracoPart>(*geometry);
  part->has_indices = false;
  part->attributes.clear();
  for (const Replaced& r : replaced) add_attribute(d, r, *part);
  const int buffer = add_part(d, part);
  uint64_t offset = 0;
  for (const Replaced& r : replaced)
    offset += move_accessor(d, *r.accessor, part->vertices, buffer, offset);
}

void check_compressed(const Document& d, const BufferView& view, const std::string& where) {
  const BufferSource& buffer = d.buffers[static_cast<size_t>(view.buffer)];
  const char* const name =
      buffer.meshopt ? buffer.meshopt->extension : "KHR_draco_mesh_compression";
  if (buffer.meshopt) check_parent(d, view, where);
  const CompressedBytes& from = buffer.meshopt ? buffer.meshopt->from : buffer.draco->from;
  const std::string what = where + ": its " + name;
  const auto index = static_cast<size_t>(from.buffer);
  if (from.buffer < 0 || index >= d.buffers.size() ||
      d.buffers[index].kind == BufferSource::Kind::kDecoded)
    refuse(d.path, what + ": buffer " + std::to_string(from.buffer) +
                       " does not exist, expected a buffer of the file");
  d.check_usable("buffers", from.buffer);
  const BufferSource& source = d.buffers[index];
  const uint128 end = static_cast<uint128>(from.byte_offset) + from.byte_length;
  if (end > source.byte_length)
    refuse(d.path, what + " ends past the " + std::to_string(source.byte_length) +
                       " bytes of buffer " + std::to_string(from.buffer) +
                       ", expected an end in the buffer");
  if (source.kind == BufferSource::Kind::kNone)
    refuse(
        d.path,
        what + ": buffer " + std::to_string(from.buffer) +
            " has no uri and is not in the file, expected a uri, or a GLB file with the chunk BIN");
  if (!(buffer.meshopt ? kHasMeshopt : kHasDraco))
    refuse(d.path, where + " is compressed by " + name +
                       ", which this voxdag was built without: decompress the file (gltf-transform "
                       "copy), or build voxdag where " +
                       (buffer.meshopt ? "libmeshoptimizer-dev" : "libdraco-dev") +
                       " is installed");
}

}  // namespace voxdag::gltf
