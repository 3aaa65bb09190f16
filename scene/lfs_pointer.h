// Refuses Git LFS pointers (core/io/lfs_pointer.h).
#pragma once

#include <string>

#include "core/io/file_system.h"

namespace voxdag {

bool is_lfs_pointer(const ReadableFile& file);

// Throws Error{kInvalidInput} if the file is a Git LFS pointer. The message begins with `where`.
void refuse_lfs_pointer(const ReadableFile& file, const std::string& where);

}  // namespace voxdag
