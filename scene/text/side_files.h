// Finds the files that a scene file refers to, such as images.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/io/file_system.h"

namespace voxdag {

// Opens the first of these paths that can be opened, relative to the folder of `from`. If none can,
// throws the Error about the first path. `paths` must not be empty.
std::unique_ptr<ReadableFile> open_first(FileSystem& files, const std::string& from,
                                         std::span<const std::string> paths);

// Opens the file `name`, relative to the folder of `from`, the file that refers to it. If this path
// cannot be opened, tries the name with slashes instead of backslashes, and then only its last
// component. For an absolute name, tries only its last component. Throws Error, about the first
// path tried, if no path can be opened.
std::unique_ptr<ReadableFile> open_side_file(FileSystem& files, const std::string& from,
                                             std::string_view name);

}  // namespace voxdag
