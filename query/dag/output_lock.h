// Keeps others from writing to the same output, since two writers would share its temporary files,
// and an output from destroying what somebody wants to keep. So the lock comes first: only under it
// is it known whether a temporary file is of a process that was killed.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag::query {

// What is about to be written: each of `paths` under the name PATH.partial at first.
struct Outputs {
  std::vector<std::string> paths;  // the first one is the one that is locked
  std::string input;               // which is read at the same time
  bool replace = false;            // files that exist
};

// The empty file OUTPUT.lock, locked, and removed at the end. A process that is killed leaves it,
// and its temporary files: the next one finds it without a holder, and removes those.
class OutputLock {
 public:
  // Throws Error: kIo if another process has it; kInvalidInput if an output has no name, is the
  // input or no regular file, or would replace a file that is not empty without `replace`;
  // kNotFound if there is no folder for it.
  OutputLock(FileSystem& files, const Outputs& outputs);
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;
  ~OutputLock();

 private:
  OutputLock(FileSystem& files, const std::string& output);

  FileSystem& files_;
  const std::string path_;
  const bool is_left_behind_;  // by one that was killed
  std::unique_ptr<FileLock> lock_;
};

}  // namespace voxdag::query
