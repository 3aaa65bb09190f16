// Prevents two builds from writing the same output: a build must lock the output's partial file.
#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag {

class OutputLock {
 public:
  // Throws Error{kInvalidInput} if another build writes there.
  OutputLock(FileSystem& files, const std::string& output)
      : files_(files), path_(output + ".partial"), lock_(files.try_lock(path_)) {
    if (!lock_)
      throw Error(ErrorCode::kInvalidInput,
                  output + " is being written by another build: expected another file (-o)");
  }
  // Removes the partial file if nothing was written to it.
  ~OutputLock() {
    try {
      if (files_.exists(path_) && files_.open_read(path_)->size() == 0) files_.remove(path_);
    } catch (const Error&) {
      // An empty file is left, which the next build there locks again.
    }
  }
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

 private:
  FileSystem& files_;
  const std::string path_;
  const std::unique_ptr<FileLock> lock_;
};

}  // namespace voxdag
