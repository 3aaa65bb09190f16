// The exports of jobs' results: files in other formats, or .vdag files of a part of the result,
// which clients download. Runs one export at a time, in a separate process like the process of a
// job. An export runs concurrently with jobs and has its own memory limit. Thread-safe.
//
// An export is a folder, DATA/jobs/JOB/exports/ID, with its files and the record export.json. The
// record is written before an export starts and after its files are complete, so a crash leaves
// either a complete export, or one that the next start of the service runs again. A folder without
// a record is the rest of an interrupted deletion, which the next start finishes. The folder is
// part of the folder of the job, so it is deleted with the job.
#pragma once

#include <array>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/base/steps.h"
#include "server/config/config.h"
#include "server/jobs/live_job.h"
#include "server/jobs/process/child_process.h"
#include "server/jobs/protocol/export_record.h"
#include "server/jobs/protocol/job_folder.h"
#include "server/queue/job_queue.h"

namespace voxdag::server {

class Exports {
 public:
  // `jobs_path`: the folder of the jobs' folders. Loads the exports of the previous service and
  // starts to run those that had not ended.
  Exports(const ServerConfig& config, FileSystem& files, JobQueue& queue, std::string jobs_path,
          Steps& steps, Log log);
  // Calls stop().
  ~Exports();

  // Tells the running export to stop. It remains queued and runs again when the service starts the
  // next time.
  void begin_stop();
  // Calls begin_stop() and waits until the export has stopped.
  void stop();

  struct Added {
    Export it;
    bool is_new = false;  // queued by this call; otherwise it was queued, running or complete
  };
  // Queues an export of a job that has succeeded. `request` is the text of an ExportSpec, `output`
  // the name of the (first) file. If the job has an export with the same request, returns it
  // instead; if that export has failed, queues it again. Throws RequestError: kLimit if the job has
  // too many exports, kBusy if too many are queued, kConflict if the job or the export is being
  // deleted.
  Added add(const std::string& job, const std::string& request, const std::string& output);
  // Returns the exports of a job, oldest first.
  std::vector<Export> list(const std::string& job) const;
  // Throws RequestError{kNotFound}.
  Export find(const std::string& job, const std::string& id) const;
  // Deletes an export and its files. If its process runs, stops the process first: then the export
  // is in the state deleting when the call returns. Returns whether the export is deleted. Throws
  // RequestError: kNotFound, or kConflict if the job is being deleted.
  bool remove(const std::string& job, const std::string& id);
  // For /metrics. The members `ended_*` count since the start of the service.
  struct Statistics {
    std::array<uint64_t, 5> exports{};     // current number of exports, by state
    std::array<uint64_t, 5> ended_runs{};  // number of runs, by the export's state after the run
    uint64_t ended_bytes = 0;              // size of the files of the runs that succeeded
    double ended_wall_s = 0;               // wall time of all ended runs
  };
  Statistics statistics() const;
  // Returns null unless the process of the export is running.
  std::shared_ptr<LiveJob> live(const std::string& id) const;
  // Returns the path of a file of the export.
  std::string path(const Export& it, const std::string& file) const;

  // Keeps the exports of a job from running while the job is deleted. The constructor stops the
  // process of an export of this job and waits for its end.
  class Pause {
   public:
    Pause(Exports& exports, const std::string& job);
    ~Pause();
    Pause(const Pause&) = delete;
    // Forgets the exports of the job. Call it after the job's folder was renamed to mark it as
    // deleted.
    void forget();

   private:
    Exports& exports_;
    const std::string job_;
  };

 private:
  struct Entry {
    Export it;
    // A thread runs this export or removes its files. Only this thread may remove the entry.
    bool is_busy = false;
    std::shared_ptr<LiveJob> live;  // set while the export's process runs
  };
  using Entries = std::map<std::string, Entry>;  // keyed by id

  std::string folder(const Export& it) const;
  void load(const std::string& job);
  void load_one(const std::string& job, const std::string& id);
  void write_record(const Export& it);
  // Removes the files of an export, except its record and its log.
  void clear(const Export& it);
  void remove_folder(const Export& it);

  // The loop of `thread_`.
  void run();
  Entry* next_ready();
  // Runs an export to its end. Unlocks the mutex in between.
  void run_one(Entry& entry, std::unique_lock<std::mutex>& lock);
  ChildProcess::End run_process(const Export& it, LiveJob& live);
  // Records the end of an export that ran for `wall_s` seconds, or removes the export if a request
  // has deleted it. Unlocks the mutex in between.
  void finish(Entry& entry, double wall_s, std::unique_lock<std::mutex>& lock);
  // Removes the files and the entry of a busy export. Unlocks the mutex in between.
  void remove_busy(Entry& entry, std::unique_lock<std::mutex>& lock);
  void check_not_paused(const std::string& job) const;

  const ServerConfig& config_;
  FileSystem& files_;
  JobQueue& queue_;
  const std::string jobs_path_;
  Steps& steps_;
  const Log log_;
  const uint64_t memory_bytes_;

  mutable std::mutex mutex_;             // guards all members below
  std::condition_variable changed_;      // a state, a pause or stops_ has changed
  std::map<std::string, Entries> jobs_;  // keyed by job
  std::set<std::string> paused_;         // jobs with a Pause
  uint64_t next_turn_ = 1;
  Statistics ended_;  // only the members `ended_*`
  bool stops_ = false;
  std::thread thread_;
};

}  // namespace voxdag::server
