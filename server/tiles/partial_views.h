// What jobs have built so far, for viewers of running ones: the subvolumes that are built,
// coarsely. A job's folder is read again at most once per second, however many ask, and takes at
// most a twentieth of one core. Remembers a few jobs, those asked for last. Thread-safe.
#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "core/io/file_system.h"
#include "scheduler/job/coarse_cubes.h"

namespace voxdag::server {

class PartialViews {
 public:
  PartialViews(FileSystem& files, size_t max_jobs) : files_(files), max_jobs_(max_jobs) {}

  // As docs/api.md describes it. Throws as CoarseCubes::refresh().
  std::string json(const std::string& job, const std::string& work_folder, uint64_t resolution);

 private:
  struct View {
    explicit View(std::string id) : job(std::move(id)) {}
    const std::string job;
    std::mutex mutex;  // guards the next
    CoarseCubes cubes;
    std::string json;
    double next_s = 0;  // in wall_seconds()
  };
  std::shared_ptr<View> view_of(const std::string& job);

  FileSystem& files_;
  const size_t max_jobs_;
  std::mutex mutex_;                        // guards the next
  std::list<std::shared_ptr<View>> views_;  // used last first
};

}  // namespace voxdag::server
