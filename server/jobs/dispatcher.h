// Runs the queue's jobs, each in a separate process, within the limits of number, memory and disk,
// and stops, resumes and cleans up after them. Thread-safe.
//
// Why processes: a build's memory limit holds for a process, a scene that crashes a build harms
// nothing else, and a build can be stopped, killed and reniced without touching the threads that
// answer requests. A process dies with the service; started again with the same task it resumes
// from its work folder. The queue and the folders are therefore enough to continue after any crash.
//
// What fails in a thread here ends neither the thread nor the service (Steps): a job that cannot be
// handled fails, a folder that cannot be is left alone, and all else continues.
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
#include "server/jobs/job_folders.h"
#include "server/jobs/live_job.h"
#include "server/jobs/process/child_process.h"
#include "server/jobs/task_resolver.h"
#include "server/queue/job_queue.h"

namespace voxdag::server {

class Dispatcher {
 public:
  // Called whenever a job's process has ended, with the job as it is then.
  using OnRunEnded = std::function<void(const Job&)>;

  // Repairs the queue and the folders after a crash of the last service, then starts jobs.
  Dispatcher(const ServerConfig& config, FileSystem& files, JobQueue& queue, TaskResolver& tasks,
             DiskSpace& disk, Log log, OnRunEnded on_run_ended);
  // Calls stop().
  ~Dispatcher();

  // Stops every build at a checkpoint and waits for it, for at most JobLimits::stop_timeout_s. The
  // jobs remain in the queue.
  void stop();

  // Each throws RequestError: kNotFound, or kConflict for a job in another state.
  Job cancel(const std::string& id);
  Job suspend(const std::string& id);
  Job resume(const std::string& id);
  Job retry(const std::string& id);
  // Deletes the files first, so that a full disk can be emptied. What is interrupted then is
  // finished later; until then the job cannot be tried again.
  void remove(const std::string& id);

  // Null unless the job's process runs.
  std::shared_ptr<LiveJob> live(const std::string& id) const;
  size_t running() const;
  // Totals of all running jobs.
  ClusterTasks cluster_tasks() const;
  JobFolder folder(const std::string& id) const;

 private:
  struct Worker {
    std::shared_ptr<LiveJob> live;
    std::thread thread;
    bool recorded = false;  // what became of the job
    bool done = false;
    // True if it will still record what becomes of the job.
    bool runs() const { return !recorded && !done; }
  };
  // Reserves the files of an ended job for the thread that removes them: other removals wait, and a
  // retried job does not start.
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
  // Puts jobs in order that a crash, or a queue that could not be written, left behind.
  void recover();
  void retire_old_jobs();
  // Finishes deletions that a crash or an error has interrupted.
  void finish_deletions();
  // Stops the job's tasks on the cluster, because no process follows them.
  void stop_tasks(const std::string& id);
  // True if the job no longer needs its work folder.
  void remove_work(const std::string& id);

  // The thread that starts jobs.
  void dispatch();
  void start_ready_jobs();
  // False if no job is ready, or if the limits leave no place, memory or disk for it.
  bool start_next_job();
  void start_preview();
  void start_worker(const std::string& key, std::shared_ptr<LiveJob> live,
                    std::function<void(LiveJob&)> work);
  void join_finished();

  // These run on the threads of `workers_`.
  void run_job(const Job& job, LiveJob& live);
  void record_outcome(const Job& job, LiveJob& live, const ChildProcess::End& end);
  void draw_preview(const Job& job, LiveJob& live);
  // Runs a process to its end. Asks it to stop when `live` is to stop, and kills it after `max_s`,
  // or JobLimits::stop_timeout_s after that request.
  ChildProcess::End run_child(const ChildProcess::Start& start, LiveJob& live, double max_s);

  const ServerConfig& config_;
  FileSystem& files_;
  JobQueue& queue_;
  TaskResolver& tasks_;
  DiskSpace& disk_;
  const Log log_;
  const OnRunEnded on_run_ended_;
  Steps steps_;
  ClockGuard clock_;  // used by the thread that starts jobs

  // Guards all below; held while a job's state and process change together, and not while files
  // are removed.
  mutable std::mutex mutex_;
  JobFolders folders_;
  std::map<std::string, Worker> workers_;  // by job; the one named "preview" draws a picture
  std::set<std::string> locked_;           // jobs of which a FilesLock exists
  std::condition_variable files_unlocked_;
  double next_deletions_s_ = 0;  // in wall_seconds(); infinite if there is nothing to finish
  bool stops_ = false;
  bool recovered_ = false;

  // Guards live_ alone, so that requests for progress wait for nothing else.
  mutable std::mutex live_mutex_;
  std::map<std::string, std::shared_ptr<LiveJob>> live_;  // by job

  // Used by the thread that starts jobs alone.
  double next_retirement_s_ = 0;  // in wall_seconds()
  std::thread thread_;
};

}  // namespace voxdag::server
