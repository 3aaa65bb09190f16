#include "scene/gltf/document/read_document.h"

#include <algorithm>
#include <string_view>

#include "core/base/process_limits.h"
#include "scene/gltf/document/model_reader.h"
#include "scene/gltf/document/read_elements.h"
#include "scene/gltf/document/tinygltf.h"
#include "scene/gltf/json/container.h"
#include "scene/gltf/json/json_sections.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

// The extensions that voxdag reads.
constexpr std::string_view kRead[] = {"EXT_mesh_gpu_instancing", "EXT_meshopt_compression",
                                      "KHR_draco_mesh_compression", "KHR_mesh_primitive_restart",
                                      "KHR_mesh_quantization"};

// Prefixes of extension names for materials, lights, motion and metadata. They do not affect
// vertices.
constexpr std::string_view kHarmless[] = {
    "KHR_materials_",      "KHR_texture_",          "EXT_texture_", "MSFT_texture_",
    "KHR_lights_punctual", "EXT_lights_",           "KHR_xmp",      "KHR_animation_pointer",
    "ADOBE_materials_",    "MSFT_packing_",         "AGI_stk_",     "EXT_structural_metadata",
    "EXT_mesh_features",   "EXT_instance_features", "KHR_audio",    "KHR_techniques_webgl",
    "FB_geometry_metadata"};

// True if the geometry could be different if voxdag read the extension.
bool may_change_geometry(const std::string& extension) {
  return std::ranges::find(kRead, extension) == std::end(kRead) &&
         std::ranges::none_of(kHarmless, [&](auto p) { return extension.starts_with(p); });
}

void check_required_extensions(const std::string& path, const std::deque<std::string>& required) {
  for (const std::string& name : required)
    if (may_change_geometry(name))
      refuse(path, "requires the extension " + printable(name) + ", which voxdag does not read");
}

void check_version(const std::string& path, const Asset& asset) {
  if (asset.version != "2" && !asset.version.starts_with("2."))
    refuse(path, "is glTF version " + printable(asset.version) + ", expected 2.0");
  if (!asset.min_version.empty() && asset.min_version != "2.0")
    refuse(path, "needs glTF version " + printable(asset.min_version) + ", voxdag reads 2.0");
}

// Makes the BIN chunk the source of the first buffer, if this buffer has no uri.
void place_bin_chunk(const Container& container, Document& d) {
  if (!container.has_bin || d.buffers.empty()) return;
  BufferSource& first = d.buffers[0];
  if (first.kind != BufferSource::Kind::kNone || first.is_fallback) return;
  first.kind = BufferSource::Kind::kBinChunk;
  first.range = container.bin;
}

// Memory per node of check_document(), which follows the parents of all nodes.
constexpr uint64_t kCheckBytesPerNode = 2 * sizeof(int);

// Returns a function that converts an element by `read`, charges its memory and appends it to
// `array`.
template <class T>
auto store(Document& document, std::deque<T>& array, T (*read)(const JsonElement&)) {
  return [&, read](const JsonElement& element) {
    T value = read(element);
    document.charge.add(sizeof(T) + heap_bytes(value));
    array.push_back(std::move(value));
  };
}

// Reads all sections; returns the message of the first violation, or "".
std::string read_structure(const ReadableFile& file, FileRange json, Document& d,
                           ModelReader& model, MemoryBudget& budget, const CancelToken& cancel) {
  bool has_asset = false;
  constexpr bool kArray = true, kWhole = false, kChecked = true, kUnchecked = false;
  const std::string violation = read_sections(
      file, json,
      {{"asset", kWhole, kChecked,
        [&](const JsonElement& element) {
          has_asset = true;
          d.asset = read_asset(element);
        }},
       {"extensionsUsed", kArray, kChecked, store(d, d.extensions_used, read_string)},
       {"extensionsRequired", kArray, kChecked, store(d, d.extensions_required, read_string)},
       {"materials", kArray, kUnchecked,
        [&](const ElementText& material) { model.add_material(material); }},
       {"textures", kArray, kUnchecked,
        [&](const ElementText& texture) { model.add_texture(texture); }},
       {"samplers", kArray, kUnchecked,
        [&](const ElementText& sampler) { model.add_sampler(sampler); }},
       {"images", kArray, kUnchecked,
        [&](const JsonElement& element) { model.add_image(element); }},
       {"buffers", kArray, kChecked,
        [&](const JsonElement& element) {
          BufferSource buffer = read_buffer(element, file, budget);
          d.charge.add(sizeof(buffer) + buffer.uri.capacity() + buffer.characters.capacity());
          d.buffers.push_back(std::move(buffer));
        }},
       {"bufferViews", kArray, kChecked, store(d, d.views, read_view)},
       {"accessors", kArray, kChecked, store(d, d.accessors, read_accessor)},
       {"meshes", kArray, kChecked, store(d, d.meshes, read_mesh)},
       {"skins", kArray, kChecked, store(d, d.skins, read_skin)},
       {"nodes", kArray, kChecked,
        [&](const JsonElement& element) {
          const int index = static_cast<int>(d.nodes.size());
          Node node = read_node(element, index, d);
          d.charge.add(sizeof(node) + heap_bytes(node) + kCheckBytesPerNode);
          d.nodes.push_back(std::move(node));
        }},
       {"scenes", kArray, kChecked, store(d, d.scenes, read_scene)},
       {"scene", kWhole, kChecked,
        [&](const JsonElement& element) { d.scene = element.as_index(); }}},
      budget, cancel);
  return violation.empty() && !has_asset ? "asset is missing" : violation;
}

}  // namespace

Document read_document(const ReadableFile& file, MemoryBudget& budget, const CancelToken& cancel) {
  const Container container = read_container(file);
  Document d(file.path(), budget);
  ModelReader model(file.path(), budget);
  const std::string violation = read_structure(file, container.json, d, model, budget, cancel);
  model.parse(d);
  check_version(d.path, d.asset);
  check_required_extensions(d.path, d.extensions_required);
  if (!violation.empty()) refuse(d.path, violation);
  place_bin_chunk(container, d);

  for (const auto* names : {&d.extensions_used, &d.extensions_required})
    for (const std::string& name : *names) {
      d.quantized = d.quantized || name == "KHR_mesh_quantization";
      d.has_restarts = d.has_restarts || name == "KHR_mesh_primitive_restart";
    }
  for (const std::string& name : d.extensions_used)
    if (may_change_geometry(name))
      d.warn("ignored-extension", "", "the optional extension " + printable(name) + " is ignored");
  trim_heap();  // returns the parser's freed blocks to the system
  return d;
}

}  // namespace voxdag::gltf
