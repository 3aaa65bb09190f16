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

// Opens the triangles of an open file, with axes and units unchanged. See open_scene() for memory,
// errors and lifetimes. Messages name the face or vertex.
std::unique_ptr<TriangleSource> open_ply(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel);

}  // namespace voxdag::ply
