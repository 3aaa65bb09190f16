// An STL file, binary or ASCII, as a scene.
#pragma once

#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::stl {

// True if the file is a binary or an ASCII STL file (stl_format.h).
bool is_stl(const ReadableFile& file);

// Opens the triangles of an open file, with axes and units unchanged. See open_scene() for memory,
// errors and lifetimes. Messages name the facet, and in ASCII files the line.
std::unique_ptr<TriangleSource> open_stl(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel);

}  // namespace voxdag::stl
