// Decides which files may be overwritten. Inputs are never overwritten. Files that are not empty
// and that the program did not write are overwritten only with --force.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/io/file_system.h"

namespace voxdag {

// Opens a file. Returns null if the file does not exist, even if another process removes it during
// the call.
std::unique_ptr<ReadableFile> open_if_there(FileSystem& files, const std::string& path);

// Throws Error{kInvalidInput} if `path` is a symbolic link. A rename to `path` would replace the
// link instead of the file to which it points, and this file could be anywhere. Otherwise returns
// true if anything exists at `path`.
bool refuse_link(const std::string& path);

// Throws Error{kInvalidInput} if one of `paths` is the same file as one of `inputs`. The files at
// `paths` need not exist.
void refuse_inputs(FileSystem& files, std::span<const std::string> paths,
                   std::span<const std::string> inputs);

// Throws Error{kInvalidInput} if `path` exists but is not a regular file. Also throws if the file
// is not empty and is_own(file) is false, which means that the program did not write it.
// `otherwise` is appended to the message; it names an option that helps, such as " (--force
// replaces it)".
void refuse_foreign_file(FileSystem& files, const std::string& path,
                         const std::function<bool(const ReadableFile& file)>& is_own,
                         const std::string& otherwise = "");

// True if the file begins with `bytes`. Also true if the file is shorter than `bytes` and equals
// the beginning of `bytes`.
bool begins_with(const ReadableFile& file, std::string_view bytes);

// Renames `from` to `to` in one step, unless anything exists at `to`. Returns 0, EEXIST, or another
// value of errno.
int rename_without_replacing(const std::string& from, const std::string& to);
// Like rename_without_replacing(), for file systems without renameat2(RENAME_NOREPLACE), such as
// NFS: creates the hard link `to` and removes `from`. On a file system without hard links, checks
// that nothing exists at `to` and then renames `from`, in two steps.
int rename_by_link(const std::string& from, const std::string& to);

}  // namespace voxdag
