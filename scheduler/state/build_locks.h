// The locks that keep two builds apart: one is on a file next to the output, one on the work folder
// (work_folder.h). Only its holder removes a lock's file: whoever waits for the lock then makes a
// new one. A file that is renamed, as the partial output is, could not be a lock: its name would be
// free while it is still held. A process that was killed holds its locks until the system has taken
// it apart, which takes seconds when it has mapped or written much: who finds a lock waits for it.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/io/file_system.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

// Calls `try_lock` until it returns a lock, for up to `max_s` seconds; null after that. Reports a
// warning that begins with `what` once it has waited longer than `voxdag status` may hold a lock.
std::unique_ptr<FileLock> wait_for_lock(const std::function<std::unique_ptr<FileLock>()>& try_lock,
                                        const std::string& what, double max_s,
                                        const BuildContext& context);

class OutputLock {
 public:
  // The file that is locked: empty, and there while a build writes the output.
  static std::string path_of(const std::string& output) { return output + ".lock"; }
  // Throws Error{kIo} if another build still writes there after `max_wait_s`.
  OutputLock(const BuildContext& context, const std::string& output, double max_wait_s);
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
