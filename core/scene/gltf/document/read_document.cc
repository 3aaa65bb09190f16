#include "core/scene/gltf/document/read_document.h"

#include "core/base/error.h"
#include "core/scene/gltf/document/extensions.h"

namespace voxdag::gltf {
namespace {

// Of "2.0" and the like.
int major_version(const std::string& version) {
  return version.starts_with("2.") || version == "2" ? 2 : 0;
}

void check_version(const std::string& path, const FilteredJson& json) {
  if (!json.version.empty() && major_version(json.version) != 2)
    refuse(path, "is glTF version " + printable(json.version) + ", expected 2.0");
  if (!json.min_version.empty() && json.min_version != "2.0")
    refuse(path, "needs glTF version " + printable(json.min_version) + ", voxdag reads 2.0");
}

// The GLB's own buffer is its first, if that has no uri.
void place_bin_chunk(const Container& container, std::vector<Buffer>& buffers) {
  if (!container.has_bin || buffers.empty()) return;
  if (buffers[0].source != Buffer::Source::kNone) return;
  buffers[0].source = Buffer::Source::kFile;
  buffers[0].text = container.bin;
}

}  // namespace

Document read_document(const ReadableFile& file, MemoryBudget& budget, const CancelToken& cancel) {
  const Container container = read_container(file);
  FilteredJson json = filter_json(file, container.json, budget, cancel);
  check_version(file.path(), json);
  check_required_extensions(file.path(), json.extensions_required);
  if (!json.violation.empty()) refuse(file.path(), json.violation);

  Document document;
  document.path = file.path();
  document.buffers = std::move(json.buffers);
  place_bin_chunk(container, document.buffers);
  for (const auto* names : {&json.extensions_used, &json.extensions_required})
    for (const std::string& name : *names)
      document.quantized = document.quantized || name == "KHR_mesh_quantization";
  for (const std::string& name : json.extensions_used)
    if (may_matter(name))
      document.warn("the optional extension " + printable(name) + " is ignored");
  parse_structure(json, budget, cancel, document);
  return document;
}

}  // namespace voxdag::gltf
