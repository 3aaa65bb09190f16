// Keeps others from writing to the same output: two writers would share its temporary file.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "core/io/file_system.h"

namespace voxdag::query {

// The empty file OUTPUT.lock, locked, and removed at the end.
class OutputLock {
 public:
  // Throws Error{kIo} if another process has it.
  OutputLock(FileSystem& files, const std::string& output);
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;
  ~OutputLock();

 private:
  FileSystem& files_;
  const std::string path_;
  decltype(std::declval<FileSystem&>().try_lock("")) lock_;
};

}  // namespace voxdag::query
