// Locks the outputs of a command, and checks that they do not destroy a file that the user wants to
// keep. Without a lock, two writers of the same output would use the same temporary files. The lock
// is taken before any temporary file is changed, because only the lock's holder can know that no
// running process uses the file.
#pragma once

#include <string>
#include <vector>

#include "core/io/output_lock.h"
#include "core/io/outputs/guarded_outputs.h"

namespace voxdag::query {

// The outputs of a command. Each output is first written as PATH.partial.
struct Outputs {
  std::vector<std::string> paths;   // the first one is locked
  std::vector<std::string> inputs;  // files that are read while the outputs are written
  bool replace = false;             // replace existing files
};

// Holds the OutputLock of the first output. If the lock file already exists but no process holds
// the lock, a killed process left it. The constructor then removes that process's temporary files.
class LockedOutputs {
 public:
  // Throws Error: kIo if another process holds the lock; kInvalidInput if an output has no name, is
  // an input, a symbolic link or not a regular file, or if it would replace a file that is not
  // empty and `replace` is false; kNotFound if an output's folder does not exist.
  LockedOutputs(FileSystem& files, const Outputs& outputs);
  // Returns the file system through which the command writes its outputs. Unless `replace` is true,
  // this file system does not replace a file that another program creates at an output's path after
  // the constructor has returned.
  FileSystem& files() { return guarded_; }

 private:
  const bool is_left_behind_;  // true if a killed process left its files
  const OutputLock lock_;
  GuardedOutputs guarded_;
};

}  // namespace voxdag::query
