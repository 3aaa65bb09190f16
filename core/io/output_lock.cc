#include "core/io/output_lock.h"

#include "core/base/error.h"

namespace voxdag {

OutputLock::OutputLock(FileSystem& files, const std::string& output, std::unique_ptr<FileLock> lock)
    : files_(files), path_(path_of(output)), lock_(std::move(lock)) {
  if (!lock_)
    throw Error(ErrorCode::kIo,
                output +
                    " is being written by another process: expected another file (-o), or to wait "
                    "for that process");
  registered_.emplace(path_);
}

OutputLock::~OutputLock() {
  try {
    // If the file is not empty, voxdag did not create it, so it is kept.
    const auto found = files_.identify(path_);
    if (found && found->bytes == 0) files_.remove(path_);
  } catch (const Error&) {
    // The empty lock file remains. The next process that writes this output locks it.
  }
}

}  // namespace voxdag
