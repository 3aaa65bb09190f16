// What jobs have built so far, for viewers of running ones: the subvolumes that are built,
// coarsely, as a list and as a DAG. A job's folder is read again at most once per second, however
// many ask, by one of them, while the others have the last answer; that takes at most a twentieth
// of one core, and only so many subvolumes are read at once: those of a large job appear step by
// step. Remembers a few jobs, those asked for last. Thread-safe.
#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "core/io/file_system.h"
#include "server/jobs/process/job_folder.h"
#include "server/tiles/coarse_cubes.h"
#include "server/tiles/manifest.h"
#include "server/tiles/partial_dag.h"
#include "server/tiles/viewed_dag.h"

namespace voxdag::server {

class PartialViews {
 public:
  // Nodes that no root leads to any more are forgotten when a DAG has more words than `max_words`.
  PartialViews(FileSystem& files, size_t max_jobs, uint64_t max_words = uint64_t{1} << 21)
      : files_(files), max_jobs_(max_jobs), max_words_(max_words) {}

  // As docs/api.md describes it. Throws as CoarseCubes::refresh(), Error{kNotFound} before the
  // subvolumes are planned and when the folder is removed just then, and Problem (503) if all
  // jobs that are remembered were asked for in the last seconds.
  std::string json(const std::string& job, const JobFolder& folder, uint64_t resolution);
  // The same as a DAG of the job's grid.
  std::shared_ptr<const ViewedDag> dag(const std::string& job, const JobFolder& folder,
                                       uint64_t resolution);
  // The last one that dag() returned, if it is remembered and has this digest; else null. Whether
  // the folder is still there does not matter.
  std::shared_ptr<const ViewedDag> known(const std::string& job, const std::string& digest);

  // Forgets a job: one that is deleted, or begins again. Requests that still use it finish.
  void close(const std::string& job);
  // Forgets those that were not asked for in `max_idle_s`.
  void close_stale(double max_idle_s);

 private:
  struct Nodes {
    explicit Nodes(uint32_t levels, std::string name) : dag(levels), digest(std::move(name)) {}
    PartialDag dag;
    const std::string digest;
    uint64_t max_words = 0;  // from which on they are made again
  };
  struct View {
    explicit View(std::string id) : job(std::move(id)) {}
    const std::string job;
    double used_s = 0;  // guarded by the mutex of all views

    std::mutex work_mutex;  // held by the one that reads the folder; guards the next
    CoarseCubes cubes;
    uint64_t version = 0;     // counts looks at the folder that went well
    bool failed = false;      // the last one
    double next_s = 0;        // in wall_seconds(): when the folder may be read again,
    double paid_until_s = 0;  // and until when it must not be, because of what the CPU has done
    nlohmann::ordered_json frame;  // of the manifest: what does not change; null before the plan
    uint64_t frame_version = 0;    // when the plan was looked for
    std::unique_ptr<Nodes> nodes;
    uint64_t json_version = 0, dag_version = 0;  // of the answers

    std::mutex mutex;  // never held for long; guards the next
    std::shared_ptr<const std::string> json;
    std::shared_ptr<const ViewedDag> dag;        // null when it is that of an earlier run
    std::shared_ptr<const ViewedDag> known_dag;  // it stays then
  };
  using Views = std::list<std::shared_ptr<View>>;

  std::shared_ptr<View> view_of(const std::string& job, const JobFolder& folder);
  // The one of a job, now used last, or null. The mutex is held.
  std::shared_ptr<View> find(const std::string& job);
  template <class Answer, class Update>
  std::shared_ptr<const Answer> look(View& view, const JobFolder& folder,
                                     std::shared_ptr<const Answer> View::*answer,
                                     const Update& update);
  void refresh(View& view, const std::string& work_folder);
  void begin_again(View& view);
  void update_json(View& view, uint64_t resolution);
  void update_dag(View& view, const JobFolder& folder, uint64_t resolution);

  FileSystem& files_;
  const size_t max_jobs_;
  const uint64_t max_words_;
  std::mutex mutex_;  // guards the next
  Views views_;       // used last first
};

}  // namespace voxdag::server
