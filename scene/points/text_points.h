// Points in a text file: one row per point (docs/scenes.md, "Text files with points").
#pragma once

#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::points {

// True if the first row of the file has at least three fields and all of them are numbers, or if it
// names the columns of the second row. Also true if the file's name ends with .xyz, .txt or .csv
// and its beginning is text that is not JSON.
bool is_text_points(const ReadableFile& file);

// Opens the points of an open text file as a scene. Reads all lines once, to count the rows and to
// store the place of every 1024th row. See open_scene() for memory, errors and lifetimes.
std::unique_ptr<TriangleSource> open_text_points(FileSystem& files,
                                                 std::unique_ptr<ReadableFile> file,
                                                 const SceneOptions& options, MemoryBudget& budget,
                                                 const CancelToken& cancel);

}  // namespace voxdag::points
