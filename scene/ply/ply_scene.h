// A PLY file as a scene.
#pragma once

#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::ply {

// True if the file begins with "ply" and an end of line.
bool is_ply(const ReadableFile& file);

// The triangles of an open file, its axes and units unchanged. Memory, errors and lifetimes are
// those of open_scene(); the messages name face or vertex.
std::unique_ptr<TriangleSource> open_ply(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel);

}  // namespace voxdag::ply
