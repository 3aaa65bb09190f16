// The points of a LAS file. Withheld points are left out.
#pragma once

#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::points {

// Opens the points of an open LAS file as a scene. Reads all records once, to count the withheld
// points and to find the range of the colors. See open_scene() for memory, errors and lifetimes.
std::unique_ptr<TriangleSource> open_las(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel);

}  // namespace voxdag::points
