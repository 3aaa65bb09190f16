// Takes jobs from the queue and runs each in a process of its own, as many as slots, memory and
// disk allow; and everything that stops, continues or cleans up after them.
//
// Why processes: the memory promise of a build is one of a process, a scene that crashes a build
// takes nothing else along, and a build can be stopped, killed and reniced without touching the
// threads that answer. A process dies with the service; started again with the same task it goes on
// where its work folder is. So whatever happens to either, the queue's state and the folders are
// enough to carry on.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/config.h"
#include "server/jobs/live_job.h"
#include "server/jobs/process/child_process.h"
#include "server/jobs/process/job_folder.h"
#include "server/jobs/task_resolver.h"
#include "server/queue/job_queue.h"

namespace voxdag::server {

class Dispatcher {
 public:
  using Log = std::function<void(const std::string& line)>;

  // Told of every job whose process has ended, as it is then.
  using OnSettled = std::function<void(const Job&)>;

  // Brings the queue and the folders in order after whatever ended the last service, then begins.
  Dispatcher(const ServerConfig& config, FileSystem& files, JobQueue& queue, TaskResolver& tasks,
             Log log, OnSettled on_settled);
  // As stop().
  ~Dispatcher();

  // Stops every build at a checkpoint and waits for it, for at most a grace. They stay in the
  // queue.
  void stop();

  // Each throws Problem (404, 409).
  Job cancel(const std::string& id);
  Job suspend(const std::string& id);
  Job resume(const std::string& id);
  Job retry(const std::string& id);
  void remove(const std::string& id);

  // Null unless its process runs.
  std::shared_ptr<LiveJob> live(const std::string& id) const;
  size_t running() const;
  JobFolder folder(const std::string& id) const;

 private:
  struct Worker {
    std::shared_ptr<LiveJob> live;
    std::thread thread;
    bool done = false;
  };

  void clean_up_folders();
  void retire_old_jobs();

  // The thread that starts jobs.
  void dispatch();
  void start_ready_jobs();
  // False if there is none, or no slot, memory or disk for it.
  bool start_next_job();
  void start_preview();
  void begin(const std::string& key, std::shared_ptr<LiveJob> live,
             std::function<void(LiveJob&)> work);
  void join_finished();

  // What the threads of `workers_` do.
  void run_job(const Job& job, LiveJob& live);
  void settle(const Job& job, LiveJob& live, const ChildProcess::End& end);
  void draw_preview(const Job& job, LiveJob& live);
  // Until its end; asks it to stop when `live` is to, and kills it after `max_s` or a grace.
  ChildProcess::End run_child(const ChildProcess::Start& start, LiveJob& live, double max_s);

  const ServerConfig& config_;
  FileSystem& files_;
  JobQueue& queue_;
  TaskResolver& tasks_;
  const Log log_;
  const OnSettled on_settled_;
  const std::string program_;

  mutable std::mutex
      mutex_;  // guards all below; held while a job's state and process change together
  std::map<std::string, Worker> workers_;  // by job; "preview" draws a picture
  bool stops_ = false;
  double last_retired_s_ = 0;

  mutable std::mutex live_mutex_;  // guards the next: who asks for progress waits for nothing else
  std::map<std::string, std::shared_ptr<LiveJob>> live_;  // by job

  std::thread thread_;
};

}  // namespace voxdag::server
