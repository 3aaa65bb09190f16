// Runs the queue's jobs, each in a separate process, within limits of their number, memory and disk
// space. Stops and resumes jobs, and cleans up after them. Thread-safe.
//
// Each job runs in a separate process for three reasons: a memory limit applies to a process; a
// scene that crashes a build harms nothing else; and the service can stop, kill and renice a build
// without touching the threads that answer requests. A job's process dies with the service. A new
// process with the same task resumes from the job's work folder. So the queue and the folders are
// enough to continue after any crash.
//
// A failure in a thread of the dispatcher ends neither the thread nor the service
// (server/base/steps.h). If a step for a job throws, the job fails or the step is repeated. If a
// step that removes a folder throws, the folder is kept. All other work continues.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "server/base/clock_guard.h"
#include "server/base/steps.h"
#include "server/config/config.h"
#include "server/disk/disk_space.h"
#include "server/jobs/exports.h"
#include "server/jobs/job_folders.h"
#include "server/jobs/live_job.h"
#include "server/jobs/process/child_process.h"
#include "server/jobs/task_resolver.h"
#include "server/queue/job_queue.h"

namespace voxdag::server {

class Dispatcher {
 public:
  // Called after a job's process has ended and the job's new state was recorded.
  using OnRunEnded = std::function<void(const Job&)>;

  // Repairs the queue and the folders after a crash of the previous service, then starts jobs.
  Dispatcher(const ServerConfig& config, FileSystem& files, JobQueue& queue, TaskResolver& tasks,
             DiskSpace& disk, Log log, OnRunEnded on_run_ended);
  // Calls stop().
  ~Dispatcher();

  // Tells every build to stop at a checkpoint, and kills builds that still run after
  // JobLimits::stop_timeout_s. The jobs remain in the queue.
  void stop();

  // Each of these functions throws RequestError: kNotFound for an unknown job, or kConflict if the
  // job's state does not allow the change.
  Job cancel(const std::string& id);
  Job suspend(const std::string& id);
  Job resume(const std::string& id);
  Job retry(const std::string& id);
  // Deletes a job. Removes its files before its record, so that the call frees space even on a full
  // disk. An interrupted removal is finished later; until then the job cannot be retried.
  void remove(const std::string& id);

  // Returns null unless the job's process is running.
  std::shared_ptr<LiveJob> live(const std::string& id) const;
  // Returns the number of running job processes.
  size_t running() const;
  // Returns the numbers of cluster tasks of all running jobs together. Sets only `waiting`,
  // `failed_attempts` and `running`.
  ClusterTasks cluster_tasks() const;
  JobFolder folder(const std::string& id) const;
  // The exports of the jobs' results.
  Exports& exports() { return *exports_; }

 private:
  struct Worker {
    std::shared_ptr<LiveJob> live;
    std::thread thread;
    bool recorded = false;  // the job's outcome is in the queue
    bool done = false;
    // True if the worker will still record the job's outcome.
    bool is_running() const { return !recorded && !done; }
  };
  // Gives one thread exclusive access to the files of a job that has no process. The thread removes
  // files or stops cluster tasks. While this object exists, other removals of these files wait, and
  // the job does not start even if a client retries it.
  class FilesLock {
   public:
    FilesLock(Dispatcher& dispatcher, const std::string& id);
    ~FilesLock();
    FilesLock(const FilesLock&) = delete;

   private:
    Dispatcher& dispatcher_;
    const std::string id_;
  };

  bool stopping();
  // Repairs the states of jobs after a crash or after the queue could not be written.
  void recover();
  void retire_old_jobs();
  // Finishes deletions that a crash or an error interrupted.
  void finish_deletions();
  // Stops the tasks that a job without a process has left on the cluster.
  void stop_tasks(const std::string& id);
  // Removes the job's work folder if the job has been canceled or has succeeded.
  void remove_work(const std::string& id);

  // The loop of the thread that starts jobs.
  void dispatch();
  void start_ready_jobs();
  // Starts the next ready job. Returns false if no job is ready, or if the limits leave no slot,
  // memory or disk space for it.
  bool start_next_job();
  void start_preview();
  void start_worker(const std::string& key, std::shared_ptr<LiveJob> live,
                    std::function<void(LiveJob&)> work);
  void join_finished();

  // The following functions run on the threads of `workers_`.
  void run_job(const Job& job, LiveJob& live);
  void record_outcome(const Job& job, LiveJob& live, const ChildProcess::End& end);
  void draw_preview(const Job& job, LiveJob& live);
  // Runs a process to its end (run_child.h).
  ChildProcess::End run_process(const ChildProcess::Start& start, LiveJob& live, double max_s);

  const ServerConfig& config_;
  FileSystem& files_;
  JobQueue& queue_;
  TaskResolver& tasks_;
  DiskSpace& disk_;
  const Log log_;
  const OnRunEnded on_run_ended_;
  Steps steps_;
  ClockGuard clock_;  // used by the thread that starts jobs

  // Guards the members below, up to live_mutex_. A thread also holds this mutex while it changes
  // both a job's state and its process, but not while it removes files.
  mutable std::mutex mutex_;
  JobFolders folders_;
  // Keyed by job id. The worker with the key "preview" renders the preview of a finished job.
  std::map<std::string, Worker> workers_;
  std::set<std::string> locked_;  // jobs with a FilesLock
  std::condition_variable files_unlocked_;
  double next_deletions_s_ = 0;  // in wall_seconds(); infinite if no deletion is pending
  bool stops_ = false;
  bool recovered_ = false;  // if false, recover() must run before the next job starts

  // Guards only live_. This mutex is separate from mutex_, so that requests for progress do not
  // wait for changes of the queue.
  mutable std::mutex live_mutex_;
  std::map<std::string, std::shared_ptr<LiveJob>> live_;  // keyed by job

  std::unique_ptr<Exports> exports_;

  // Used only by the thread that starts jobs.
  double next_retirement_s_ = 0;  // in wall_seconds()
  std::thread thread_;
};

}  // namespace voxdag::server
