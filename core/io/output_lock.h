// A lock that prevents two processes from writing the same output, because they would use the same
// temporary files.
//
// Only the holder of the lock removes the lock file. If another process tries to lock the file at
// that moment, it notices the removal and creates a new file. A killed process leaves the empty
// lock file behind, and the next process locks this file. The partial output file cannot serve as
// the lock file: after its rename, its name would be free while the lock is still held.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/io/file_system.h"
#include "core/io/temporary_paths.h"

namespace voxdag {

class OutputLock {
 public:
  // Returns the path of the lock file. The lock file is empty and exists while a process writes the
  // output.
  static std::string path_of(const std::string& output) { return output + ".lock"; }
  // Throws Error{kIo} if another process holds the lock.
  OutputLock(FileSystem& files, const std::string& output)
      : OutputLock(files, output, files.try_lock(path_of(output))) {}
  // Takes over `lock`, which try_lock(path_of(output)) returned. Throws Error{kIo} if it is null,
  // which means that another process holds the lock.
  OutputLock(FileSystem& files, const std::string& output, std::unique_ptr<FileLock> lock);
  // Removes the lock file.
  ~OutputLock();
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

 private:
  FileSystem& files_;
  const std::string path_;
  const std::unique_ptr<FileLock> lock_;
  std::optional<TemporaryPath> registered_;
};

}  // namespace voxdag
