// Temporary files and folders that a process removes if it ends before their owners can remove
// them. Paths of a killed process remain; the next command with the same output, or the user,
// removes them.
#pragma once

#include <string>

namespace voxdag {

// Registers a temporary file or folder during the lifetime of this object. Does not remove it.
// Thread-safe.
class TemporaryPath {
 public:
  explicit TemporaryPath(std::string path);
  ~TemporaryPath();
  TemporaryPath(const TemporaryPath&) = delete;
  TemporaryPath& operator=(const TemporaryPath&) = delete;

 private:
  const std::string path_;
};

// Removes all registered files and folders. Call it immediately before the process ends. Ignores
// errors. Other threads can still be writing to the files.
void remove_temporary_paths();

}  // namespace voxdag
