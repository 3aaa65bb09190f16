// Reads the JSON of a scene file once, from beginning to end, and makes of it
//   - the text of what gltf_schema() names, type-checked, for tinygltf;
//   - what tinygltf must not see (buffers, which it would load) or what decides whether to go on
//     at all (versions, extensions).
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "core/scene/gltf/document/document.h"
#include "core/scene/gltf/json/json_slices.h"

namespace voxdag::gltf {

// The member "indices" of a primitive.
struct PrimitiveIndices {
  uint32_t mesh;
  uint32_t primitive;
  int accessor;
};

struct FilteredJson {
  explicit FilteredJson(MemoryBudget& budget, const std::string& what) : slices(budget, what) {}

  JsonSlices slices;
  std::map<std::string, uint64_t> element_counts;  // of the root's arrays, by name
  std::vector<PrimitiveIndices> indices;
  std::string version;
  std::string min_version;
  std::vector<std::string> extensions_used;
  std::vector<std::string> extensions_required;
  std::vector<Buffer> buffers;
  // The first member that is missing, repeated or of a wrong type, and what was expected there;
  // empty if none. Then the slices are not to be used, but the versions still tell a glTF 1.0 file.
  std::string violation;
};

// Throws Error{kInvalidInput} for what is no JSON, Error{kOutOfMemory} for what does not fit.
FilteredJson filter_json(const ReadableFile& file, FileRange json, MemoryBudget& budget,
                         const CancelToken& cancel);

}  // namespace voxdag::gltf
