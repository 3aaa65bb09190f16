// Locks the outputs of a command. Two writers of the same output would share its temporary files,
// and an output must not destroy a file that the user wants to keep. The lock comes first, because
// only its holder knows if a temporary file was left by a killed process.
#pragma once

#include <string>
#include <vector>

#include "core/io/output_lock.h"

namespace voxdag::query {

// The outputs of a command; each of `paths` is first written as PATH.partial.
struct Outputs {
  std::vector<std::string> paths;  // the first one is locked
  std::string input;               // this file is read while the outputs are written
  bool replace = false;            // replace existing files
};

// Holds the OutputLock of the first output. Removes the temporary files of a killed process,
// recognized by a lock file without a holder.
class LockedOutputs {
 public:
  // Throws Error: kIo if another process holds the lock; kInvalidInput if an output has no name, is
  // the input or is not a regular file, or if it would replace a file that is not empty and
  // `replace` is false; kNotFound if an output's folder does not exist.
  LockedOutputs(FileSystem& files, const Outputs& outputs);

 private:
  const bool is_left_behind_;  // true if a killed process left its files
  const OutputLock lock_;
};

}  // namespace voxdag::query
