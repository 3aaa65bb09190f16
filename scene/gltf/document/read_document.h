// Makes a Document from the bytes of a scene file.
#pragma once

#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/gltf/document/document.h"
#include "voxdag/cancel_token.h"

namespace voxdag::gltf {

// Returns the document of an open scene file, not yet checked by check_document(). Throws
// Error{kInvalidInput} for malformed JSON, a member of a wrong type, an unsupported glTF version,
// and an unsupported required extension that is not in `ignored_extensions`. Throws
// Error{kOutOfMemory} for a structure that does not fit the budget.
Document read_document(const ReadableFile& file, const std::vector<std::string>& ignored_extensions,
                       MemoryBudget& budget, const CancelToken& cancel);

}  // namespace voxdag::gltf
