// Converts a scene file that assimp reads (FBX, COLLADA, 3DS, 3MF, OFF and others) to a .glb:
// triangles, transforms of nodes, materials, images. docs/scenes.md, "Other formats", lists the
// rules.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/base/progress.h"
#include "core/base/warning.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

struct ImportReport {
  uint64_t triangles = 0;  // stored triangles; a mesh of several nodes counts once
  uint64_t meshes = 0, nodes = 0, materials = 0, images = 0;
  uint64_t bytes = 0;  // size of the .glb
};

// Writes `output` from `input`. assimp runs in a child process that may use `memory_bytes` of
// memory (confined_process.h). Calls warn() for each kind of content that is lost. Throws Error,
// also if `output` or "<output>.partial" is a file of the scene, such as an image. After any other
// failure, also of warn(), neither `output` nor "<output>.partial" remains.
ImportReport import_scene(FileSystem& files, const std::string& input, const std::string& output,
                          uint64_t memory_bytes, const std::function<void(const Warning&)>& warn,
                          Progress& progress, const CancelToken& cancel);

// True if import_scene() wrote the file.
bool is_imported_scene(const ReadableFile& file);

}  // namespace voxdag
