// An OBJ file as a scene.
#pragma once

#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::obj {

// True if the file begins with statements of OBJ. The format has no magic number, so the lines are
// tested until one has the arguments of its kind (numbers after v, vt and vn, indices after f, l
// and p, a name after mtllib and usemtl). All lines before it must be blank, comments or OBJ
// statements. At most the first MiB is read.
bool is_obj(const ReadableFile& file);

// Opens the triangles of an open file, with axes and units unchanged. See open_scene() for memory,
// errors and lifetimes. Messages name the line.
std::unique_ptr<TriangleSource> open_obj(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                         const SceneOptions& options, MemoryBudget& budget,
                                         const CancelToken& cancel);

}  // namespace voxdag::obj
