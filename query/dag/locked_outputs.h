// Keeps others from writing to the same output, since two writers would share its temporary files,
// and an output from destroying what somebody wants to keep. So the lock comes first: only under it
// is it known whether a temporary file is of a process that was killed.
#pragma once

#include <string>
#include <vector>

#include "core/io/output_lock.h"

namespace voxdag::query {

// The outputs of a command; each of `paths` is first written as PATH.partial.
struct Outputs {
  std::vector<std::string> paths;  // the first one is locked
  std::string input;               // read while the outputs are written
  bool replace = false;            // files that exist
};

// Holds the OutputLock of the first output. Removes the temporary files of a killed process, which
// left its lock without a holder.
class LockedOutputs {
 public:
  // Throws Error: kIo if another process holds the lock; kInvalidInput if an output has no name, is
  // the input or no regular file, or would replace a file that is not empty without `replace`;
  // kNotFound if an output's folder does not exist.
  LockedOutputs(FileSystem& files, const Outputs& outputs);

 private:
  const bool is_left_behind_;  // by a killed process
  const OutputLock lock_;
};

}  // namespace voxdag::query
