// A file system that opens only the given files for reading. Without this class, an uploaded scene
// could read any file of the machine by naming it as a buffer: directly, with "..", or through a
// symbolic link. Calls that do not open a file for reading are forwarded.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/io/forwarding_files.h"

namespace voxdag::server {

class ConfinedFiles : public ForwardingFiles {
 public:
  // `readable` has the paths of files that may be read, and of folders all of whose files may be
  // read. The path of a folder ends in '/'. A path that does not exist yet must not contain
  // symbolic links, "." or "..".
  ConfinedFiles(FileSystem& files, const std::vector<std::string>& readable);

  // These functions open a file for reading. Error messages contain `path` as given. They throw
  // Error{kInvalidInput} if reading the file is not allowed.
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override;
  std::unique_ptr<ReadableFile> open_own(const std::string& path) override;

 private:
  using Open = std::unique_ptr<ReadableFile> (FileSystem::*)(const std::string& path);
  std::unique_ptr<ReadableFile> open_checked(Open open, const std::string& path);

  std::vector<std::string> readable_;  // resolved
};

// Returns the absolute path without symbolic links, "." and ".."; "" if nothing exists there.
std::string resolved_path(const std::string& path);
// True if a resolved path equals `place` or, if `place` ends in '/', is below it.
bool is_within(const std::string& path, const std::string& place);

}  // namespace voxdag::server
