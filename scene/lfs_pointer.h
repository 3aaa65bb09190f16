// Git LFS pointers: the small texts that replace files in a clone without git lfs.
#pragma once

#include <string>

#include "core/io/file_system.h"

namespace voxdag {

// The first bytes of every pointer.
inline constexpr const char* kLfsPointerBegin = "version https://git-lfs.github.com/spec/";

bool is_lfs_pointer(const ReadableFile& file);

// Throws Error{kInvalidInput}, beginning with `where`, if the file is a pointer.
void refuse_lfs_pointer(const ReadableFile& file, const std::string& where);

}  // namespace voxdag
