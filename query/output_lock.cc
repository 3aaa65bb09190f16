#include "query/output_lock.h"

#include "core/base/error.h"

namespace voxdag::query {

OutputLock::OutputLock(FileSystem& files, const std::string& output)
    : files_(files), path_(output + ".lock"), lock_(files.try_lock(path_)) {
  if (!lock_)
    throw Error(ErrorCode::kIo,
                output +
                    " is being written by another process: expected another file (-o), or to wait "
                    "for that process");
}

OutputLock::~OutputLock() {
  try {
    // A file of that name that is not empty is somebody else's.
    if (files_.open_read(path_)->size() == 0) files_.remove(path_);
  } catch (const Error&) {
    // An empty file is left, which the next one that writes there locks again.
  }
}

}  // namespace voxdag::query
