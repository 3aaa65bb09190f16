// Reads the structs of a Document, each from its JSON element. Ignores members that voxdag does not
// use. Throws Violation for a member that is missing or of a wrong type.
#pragma once

#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/gltf/document/document.h"
#include "scene/gltf/json/json_element.h"

namespace voxdag::gltf {

Asset read_asset(const JsonElement& element);
std::string read_string(const JsonElement& element);
// Reads a buffer. Parts of a data: URI can be decoded from the file later, when they are needed, if
// the URI is base64 and has no JSON escapes, blanks or other irregular characters. Any other data:
// URI is decoded into memory here. Throws Error{kOutOfMemory} if the URI does not fit the budget.
BufferSource read_buffer(const JsonElement& element, const ReadableFile& scene_file,
                         MemoryBudget& budget);
BufferView read_view(const JsonElement& element);
Accessor read_accessor(const JsonElement& element);
Mesh read_mesh(const JsonElement& element);
Skin read_skin(const JsonElement& element);
// Reads node `index` of the document. Adds a warning if its rotation quaternion is far from unit
// length. Throws Violation for a transform that is not affine or not finite.
Node read_node(const JsonElement& element, int index, Document& document);
// Returns the root nodes of a scene.
std::vector<int> read_scene(const JsonElement& element);

// Returns the heap memory that a struct owns.
inline uint64_t heap_bytes(const BufferView& view) {
  return view.meshopt ? sizeof(MeshoptView) : 0;
}
inline uint64_t heap_bytes(const std::string& text) { return text.capacity(); }
uint64_t heap_bytes(const Accessor& accessor);
uint64_t heap_bytes(const Mesh& mesh);
uint64_t heap_bytes(const Skin& skin);
uint64_t heap_bytes(const Node& node);
uint64_t heap_bytes(const std::vector<int>& nodes);

}  // namespace voxdag::gltf
