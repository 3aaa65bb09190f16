// The views of the jobs whose unfinished results are being viewed: a few, those requested last.
// Thread-safe.
#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "server/tiles/partial/partial_view.h"

namespace voxdag::server {

class PartialViews {
 public:
  // A DAG of more than `max_words` words is made again without the nodes that no root reaches.
  PartialViews(FileSystem& files, size_t max_jobs, uint64_t max_words = uint64_t{1} << 21)
      : files_(files), max_jobs_(max_jobs), max_words_(max_words) {}

  // The built subvolumes as JSON (docs/api.md). Throws as CoarseCubes::refresh(); Error{kNotFound}
  // before the subvolumes are planned, and if the folder is removed during the call; RequestError
  // (kBusy) if all remembered jobs were requested in the last seconds.
  std::string json(const std::string& job, const JobFolder& folder, uint64_t resolution);
  // The same as the tiles of a DAG of the job's grid.
  std::shared_ptr<const TileSource> tiles(const std::string& job, const JobFolder& folder,
                                          uint64_t resolution);
  // The last result of tiles() if it is remembered and has this digest; else null. Does not read
  // the job's folder.
  std::shared_ptr<const TileSource> known(const std::string& job, const std::string& digest);
  // Forgets a job that is deleted or restarted. Requests in progress finish.
  void close(const std::string& job);
  // Forgets jobs that were not requested in the last `max_idle_s`.
  void close_stale(double max_idle_s);

 private:
  struct Entry {
    std::shared_ptr<PartialView> view;
    double used_s;
  };
  template <class Read>
  auto read(const std::string& job, const JobFolder& folder, const Read& read);
  std::shared_ptr<PartialView> view_of(const std::string& job, const JobFolder& folder);
  // The view of a job, now the last used, or null. The mutex is held.
  std::shared_ptr<PartialView> find(const std::string& job);

  FileSystem& files_;
  const size_t max_jobs_;
  const uint64_t max_words_;
  std::mutex mutex_;          // guards the next
  std::list<Entry> entries_;  // last used first
};

}  // namespace voxdag::server
