// A file system that reads only the given files. It protects against uploaded scenes, which may
// refer to any file as their buffers, by "..", or through symbolic links. All other calls are
// forwarded.
#pragma once

#include <string>
#include <vector>

#include "core/io/forwarding_files.h"

namespace voxdag::server {

class ConfinedFiles : public ForwardingFiles {
 public:
  // `readable`: files, or folders with all files below them (ending in '/'). Paths that do not
  // exist yet must not contain symbolic links or dots.
  ConfinedFiles(FileSystem& files, const std::vector<std::string>& readable);

  // Opens a file for reading. Error messages contain `path` as given. Throws Error{kInvalidInput}
  // if reading the file is not allowed.
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override;

 private:
  std::vector<std::string> readable_;  // resolved
};

// Returns the path without symbolic links and dots; "" if nothing exists there.
std::string resolved_path(const std::string& path);
// True if a resolved path equals `place` or, if `place` ends in '/', is below it.
bool is_within(const std::string& path, const std::string& place);

}  // namespace voxdag::server
