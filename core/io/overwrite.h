// Decides which files may be overwritten: never an input, and a file that the program did not make
// only with --force.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/io/file_system.h"

namespace voxdag {

// Null if there is no file of that name: another process may just have removed it.
std::unique_ptr<ReadableFile> open_if_there(FileSystem& files, const std::string& path);

// Throws Error{kInvalidInput} if one of `paths`, which need not exist, is the same file as one of
// `inputs`.
void refuse_inputs(FileSystem& files, std::span<const std::string> paths,
                   std::span<const std::string> inputs);

// Throws Error{kInvalidInput} if `path` is no regular file, or neither empty nor `is_own`, which
// looks whether the program made it. `otherwise` ends the message.
void refuse_foreign_file(FileSystem& files, const std::string& path,
                         const std::function<bool(const ReadableFile& file)>& is_own,
                         const std::string& otherwise = "");

// True if the file begins with `bytes`, or with a part of them where it ends early.
bool begins_with(const ReadableFile& file, std::string_view bytes);

}  // namespace voxdag
