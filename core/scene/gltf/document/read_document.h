// From the bytes of a scene file to its Document: container, JSON, tinygltf, checks.
#pragma once

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "core/scene/gltf/document/document.h"
#include "core/scene/gltf/json/container.h"
#include "core/scene/gltf/json/json_filter.h"

namespace voxdag::gltf {

// The document of an open scene file, not yet checked. Throws Error{kInvalidInput} for JSON that is
// broken or of a wrong shape, another glTF version, or a required extension that is not known.
Document read_document(const ReadableFile& file, MemoryBudget& budget, const CancelToken& cancel);

// The structs of what filter_json() let through, by way of tinygltf.
void parse_structure(const FilteredJson& json, MemoryBudget& budget, const CancelToken& cancel,
                     Document& document);

// Checks what the struct comments of Document promise of nodes, scenes, meshes, skins, instancing
// and accessors, but for the sizes of buffers. Throws Error{kInvalidInput} naming the offender.
void check_document(Document& document);

}  // namespace voxdag::gltf
