// Keeps two processes from writing the same output, because they would share its temporary files.
//
// Only the holder removes the lock's file; a process that waits for the lock then creates a new
// one. The partial output file cannot serve as the lock file: after its rename, its name would be
// free while the lock is still held. A killed process leaves the empty lock file behind, and the
// next process locks this file.
#pragma once

#include <memory>
#include <string>

#include "core/io/file_system.h"

namespace voxdag {

class OutputLock {
 public:
  // Path of the lock file. The file is empty and exists while a process writes the output.
  static std::string path_of(const std::string& output) { return output + ".lock"; }
  // Throws Error{kIo} if another process holds the lock.
  OutputLock(FileSystem& files, const std::string& output)
      : OutputLock(files, output, files.try_lock(path_of(output))) {}
  // Takes `lock`, the lock of path_of(output). Throws as above if `lock` is null.
  OutputLock(FileSystem& files, const std::string& output, std::unique_ptr<FileLock> lock);
  // Removes the file.
  ~OutputLock();
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

 private:
  FileSystem& files_;
  const std::string path_;
  const std::unique_ptr<FileLock> lock_;
};

}  // namespace voxdag
