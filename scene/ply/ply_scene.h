// A PLY file as a scene.
#pragma once

#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::ply {

// The triangles of an open file, its axes and units as they are. Memory, errors and lifetimes are
// as for open_scene(); the messages name face or vertex.
std::unique_ptr<TriangleSource> open_ply(std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel);

}  // namespace voxdag::ply
