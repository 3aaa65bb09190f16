// Decides which files may be overwritten. Inputs are never overwritten. Files that the program did
// not create are overwritten only with --force.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/io/file_system.h"

namespace voxdag {

// Opens a file. If the file does not exist, returns null instead of throwing: another process may
// just have removed the file.
std::unique_ptr<ReadableFile> open_if_there(FileSystem& files, const std::string& path);

// Throws Error{kInvalidInput} if one of `paths`, which need not exist, is the same file as one of
// `inputs`.
void refuse_inputs(FileSystem& files, std::span<const std::string> paths,
                   std::span<const std::string> inputs);

// Throws Error{kInvalidInput} if `path` is not a regular file. Also throws if the file is neither
// empty nor created by the program, which `is_own` checks. `otherwise` ends the message.
void refuse_foreign_file(FileSystem& files, const std::string& path,
                         const std::function<bool(const ReadableFile& file)>& is_own,
                         const std::string& otherwise = "");

// True if the file begins with `bytes`, or is shorter than `bytes` and a prefix of them.
bool begins_with(const ReadableFile& file, std::string_view bytes);

}  // namespace voxdag
