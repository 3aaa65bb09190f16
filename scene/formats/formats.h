// The table of scene formats. A new format is a folder with its reader, and one row in formats.cc.
// Messages, help, the HTTP API and the web pages list the endings of this table.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

struct SceneFormat {
  std::string_view name;                      // "glTF"
  std::span<const std::string_view> endings;  // file name endings, such as ".glb"
  // True if the file begins like this format. The first format of the table whose sniff() returns
  // true reads the file.
  bool (*sniff)(const ReadableFile& file);
  // Opens one file as open_scene() does.
  std::unique_ptr<TriangleSource> (*open)(FileSystem& files, std::unique_ptr<ReadableFile> file,
                                          const SceneOptions& options, MemoryBudget& budget,
                                          const CancelToken& cancel);
};

std::span<const SceneFormat> scene_formats();

// True if the name ends with an ending in the table, in upper or lower case.
bool has_scene_ending(std::string_view name);
// Returns all endings, with `separator` between them and `last_separator` before the last one.
std::string list_scene_endings(const std::string& separator = ", ",
                               const std::string& last_separator = " or ");

// Opens scene files, each of any format, as one scene: the triangles of the first file, then the
// triangles of the next. The contents of a file determine its format, not its name. Only text files
// with points may also be recognized by their ending. Geometry is read in windows charged to
// `budget`. Images are never read. Opening checks the structure of a file, and reading the
// triangles checks their contents. Both check `cancel`. Throws Error{kInvalidInput}, {kNotFound},
// {kLimit} or {kOutOfMemory} with the name of the file. The scene's warnings name the options that
// affect none of the files. `files`, `budget` and `cancel` must outlive
// the scene.
std::unique_ptr<TriangleSource> open_scene(FileSystem& files, const std::vector<std::string>& paths,
                                           const SceneOptions& options, MemoryBudget& budget,
                                           const CancelToken& cancel);

}  // namespace voxdag
