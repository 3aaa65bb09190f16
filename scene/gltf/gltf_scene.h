// A glTF file as a scene.
#pragma once

#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::gltf {

// Opens the default scene of an open .glb or .gltf file. See open_scene() for memory, errors and
// lifetimes. Messages name the node, mesh, primitive or accessor.
std::unique_ptr<TriangleSource> open_gltf(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                          const SceneOptions& options, MemoryBudget& budget,
                                          const CancelToken& cancel);

}  // namespace voxdag::gltf
