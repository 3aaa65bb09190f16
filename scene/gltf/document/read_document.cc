#include "scene/gltf/document/read_document.h"

#include <algorithm>
#include <string_view>

#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "scene/gltf/document/model_reader.h"
#include "scene/gltf/document/read_elements.h"
#include "scene/gltf/extensions/extension_info.h"
#include "scene/gltf/json/container.h"
#include "scene/gltf/json/json_sections.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

// Refuses required extensions that may change the geometry, unless `ignored` names them. Warns of
// all extensions that are not read.
void check_extensions(Document& d, const std::vector<std::string>& ignored) {
  const auto warn = [&](const char* code, const std::string& message) {
    d.warn(code, "", message);
  };
  for (const std::string& name : d.extensions_required) {
    const ExtensionInfo info = extension_info(name);
    const std::string extension = "the required extension " + printable(name);
    if (info.support == ExtensionSupport::kHarmless)
      warn("harmless-extension", extension + " is not read: " + info.purpose);
    if (info.support != ExtensionSupport::kUnknown) continue;
    if (std::ranges::find(ignored, name) == ignored.end())
      refuse(d.path, "requires the extension " + printable(name) +
                         ", which voxdag does not read; " + option_text("ignore_extension") +
                         " reads the file without it");
    warn("ignored-extension", extension + " is ignored on request");
    d.ignored_extensions.push_back(name);
  }
  for (const std::string& name : d.extensions_used)
    if (extension_info(name).support == ExtensionSupport::kUnknown &&
        std::ranges::find(d.extensions_required, name) == d.extensions_required.end())
      warn("ignored-extension", "the optional extension " + printable(name) + " is ignored");
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

// Memory per node for the arrays in which check_document() follows the parents of all nodes.
constexpr uint64_t kCheckBytesPerNode = 2 * sizeof(int);

// Returns read(element). If the element breaks a rule, records the message and returns T(). This is
// not an error yet, because a broken element is allowed if nothing uses it.
template <class T, class Read>
T read_or_note(Document& document, size_t index, const JsonElement& element, const Read& read) {
  try {
    return read(element);
  } catch (const Violation& violation) {
    document.add_broken(element.key(), static_cast<int>(index), violation.message);
    return T();
  }
}

// Returns a function that converts an element by `read`, charges its memory and appends it to
// `array`. For an element that breaks a rule, the function from store() throws Violation, and the
// function from store_or_note() records the message and appends T().
template <class T, class Read>
auto store(Document& document, std::deque<T>& array, const Read& read) {
  return [&, read](const JsonElement& element) {
    T value = read(element);
    document.charge.add(sizeof(T) + heap_bytes(value));
    array.push_back(std::move(value));
  };
}
template <class T>
auto store_or_note(Document& document, std::deque<T>& array, T (*read)(const JsonElement&)) {
  return store(document, array, [&, read](const JsonElement& element) {
    return read_or_note<T>(document, array.size(), element, read);
  });
}

// Reads all sections of the JSON into `d` and `model`. Returns the message of the first violation,
// or "" if no section has one.
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
          BufferSource buffer = read_or_note<BufferSource>(
              d, d.buffers.size(), element,
              [&](const JsonElement& e) { return read_buffer(e, file, budget); });
          d.charge.add(sizeof(buffer) + buffer.uri.capacity() + buffer.bytes.capacity());
          d.buffers.push_back(std::move(buffer));
        }},
       {"bufferViews", kArray, kChecked, store_or_note(d, d.views, read_view)},
       {"accessors", kArray, kChecked, store_or_note(d, d.accessors, read_accessor)},
       {"meshes", kArray, kChecked, store_or_note(d, d.meshes, read_mesh)},
       {"skins", kArray, kChecked, store_or_note(d, d.skins, read_skin)},
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
      [&](const std::string& message) { model.add_violation(message); }, budget, cancel);
  return violation.empty() && !has_asset ? "asset is missing, expected an object with version 2.0"
                                         : violation;
}

}  // namespace

Document read_document(const ReadableFile& file, const std::vector<std::string>& ignored_extensions,
                       MemoryBudget& budget, const CancelToken& cancel) {
  const Container container = read_container(file);
  Document d(file.path(), budget);
  ModelReader model(file.path(), budget);
  const std::string violation = read_structure(file, container.json, d, model, budget, cancel);
  model.parse(d);
  check_version(d.path, d.asset);
  check_extensions(d, ignored_extensions);
  if (!violation.empty()) refuse(d.path, violation);
  place_bin_chunk(container, d);

  for (const auto* names : {&d.extensions_used, &d.extensions_required})
    for (const std::string& name : *names) {
      d.quantized = d.quantized || name == "KHR_mesh_quantization";
      d.has_restarts = d.has_restarts || name == "KHR_mesh_primitive_restart";
    }
  trim_heap();  // returns the parser's freed blocks to the system
  return d;
}

}  // namespace voxdag::gltf
