// The views of the unfinished jobs that viewers requested most recently. Thread-safe.
#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "server/tiles/partial/partial_view.h"

namespace voxdag::server {

class PartialViews {
 public:
  // A DAG with more than `max_words` words is built again, without its unreachable nodes.
  PartialViews(FileSystem& files, size_t max_jobs, uint64_t max_words = uint64_t{1} << 21)
      : files_(files), max_jobs_(max_jobs), max_words_(max_words) {}

  // Returns the built subvolumes as JSON (docs/api.md). Throws Error{kNotFound} if the subvolumes
  // are not planned yet or the folder is removed during the call. Throws RequestError{kBusy} if the
  // job has no view yet, and `max_jobs` other jobs have views that were requested in the last ten
  // seconds. Also throws the errors of CoarseCubes::refresh().
  std::string json(const std::string& job, const JobFolder& folder, uint64_t resolution);
  // Returns the built subvolumes as the tiles of a DAG of the job's grid. Throws like json().
  std::shared_ptr<const TileSource> tiles(const std::string& job, const JobFolder& folder,
                                          uint64_t resolution);
  // Returns the previous result of tiles() if the job's view still has this result and the digest
  // is the same; otherwise null. Does not read the job's folder.
  std::shared_ptr<const TileSource> known(const std::string& job, const std::string& digest);
  // Drops the view of a job that was deleted or restarted. Requests in progress can finish.
  void close(const std::string& job);
  // Drops the views that were not requested in the last `max_idle_s` seconds.
  void close_stale(double max_idle_s);

 private:
  struct Entry {
    std::shared_ptr<PartialView> view;
    double used_s;
  };
  template <class Read>
  auto read(const std::string& job, const JobFolder& folder, const Read& read);
  std::shared_ptr<PartialView> view_of(const std::string& job, const JobFolder& folder);
  // Returns the view of a job, and makes it the most recently used view. Returns null if the job
  // has no view. Call it with the mutex held.
  std::shared_ptr<PartialView> find(const std::string& job);

  FileSystem& files_;
  const size_t max_jobs_;
  const uint64_t max_words_;
  std::mutex mutex_;          // guards entries_
  std::list<Entry> entries_;  // most recently used first
};

}  // namespace voxdag::server
