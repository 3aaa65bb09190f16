// Looks at a running build's job store about once per second: reports what is built, and keeps
// subvolumes.json, which the service hands out as it is. A last time when it goes.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "core/io/file_system.h"
#include "server/jobs/process/job_folder.h"
#include "server/jobs/process/progress_pipe.h"

namespace voxdag::server {

class BuiltWatch {
 public:
  BuiltWatch(FileSystem& files, const JobFolder& folder, uint64_t resolution, ProgressPipe& pipe);
  ~BuiltWatch();

 private:
  void watch();
  // Silent: looking on must not make a build fail.
  void look();

  FileSystem& files_;
  const JobFolder folder_;
  const uint64_t resolution_;
  ProgressPipe& pipe_;
  uint64_t last_built_ = 0, last_total_ = 0;
  std::mutex mutex_;  // guards ends_
  std::condition_variable wake_;
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace voxdag::server
