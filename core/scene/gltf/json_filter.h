// Reads the JSON of a scene file once, from beginning to end, and makes of it
//   - the text of what gltf_schema() names, type-checked, for tinygltf;
//   - what tinygltf must not see (buffers, which it would load) or what decides whether to go on
//     at all (versions, extensions).
#pragma once

#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "core/scene/gltf/document.h"

namespace voxdag::gltf {

struct FilteredJson {
  std::string text;
  uint64_t object_count = 0;  // in `text`
  uint64_t value_count = 0;   // in `text`, objects and arrays included
  MemoryCharge charge;        // for `text`
  std::string version;
  std::string min_version;
  std::vector<std::string> extensions_used;
  std::vector<std::string> extensions_required;
  std::vector<Buffer> buffers;
  // The first member that is missing, repeated or of a wrong type, and what was expected there;
  // empty if none. Then `text` is not to be used, but the versions still tell a glTF 1.0 file.
  std::string violation;
};

// Throws Error{kInvalidInput} for what is no JSON, Error{kOutOfMemory} for what does not fit.
FilteredJson filter_json(const ReadableFile& file, FileRange json, MemoryBudget& budget);

}  // namespace voxdag::gltf
