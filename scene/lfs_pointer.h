// Refuses Git LFS pointers (core/io/lfs_pointer.h).
#pragma once

#include <string>

#include "core/io/file_system.h"

namespace voxdag {

bool is_lfs_pointer(const ReadableFile& file);

// Throws Error{kInvalidInput}, beginning with `where`, if the file is a pointer.
void refuse_lfs_pointer(const ReadableFile& file, const std::string& where);

}  // namespace voxdag
