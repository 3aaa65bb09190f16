#include "server/jobs/dispatcher.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "scheduler/cluster/cluster.h"
#include "server/jobs/job_outcome.h"
#include "server/jobs/protocol/job_task.h"
#include "server/jobs/run_child.h"

namespace voxdag::server {
namespace {

constexpr const char* kPreview = "preview";
constexpr double kMaxPreviewS = 900;
constexpr int kPreviewNice = 5;  // in addition to the builds' nice value
constexpr double kMaxSleepS = 1;
constexpr double kNoTimeLimitS = 1e9;
constexpr double kRetireIntervalS = 300;
constexpr double kDeletionIntervalS = 30;   // between attempts of a failed deletion
constexpr size_t kMaxRetiredPerPass = 100;  // limited, so that jobs can start in between

void sleep_s(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

}  // namespace

Dispatcher::FilesLock::FilesLock(Dispatcher& dispatcher, const std::string& id)
    : dispatcher_(dispatcher), id_(id) {
  std::unique_lock lock(dispatcher_.mutex_);
  dispatcher_.files_unlocked_.wait(lock, [&] { return dispatcher_.locked_.insert(id_).second; });
}

Dispatcher::FilesLock::~FilesLock() {
  {
    std::lock_guard lock(dispatcher_.mutex_);
    dispatcher_.locked_.erase(id_);
  }
  dispatcher_.files_unlocked_.notify_all();
  dispatcher_.queue_.announce();
}

Dispatcher::Dispatcher(const ServerConfig& config, FileSystem& files, JobQueue& queue,
                       TaskResolver& tasks, DiskSpace& disk, Log log, OnRunEnded on_run_ended)
    : config_(config),
      files_(files),
      queue_(queue),
      tasks_(tasks),
      disk_(disk),
      log_(log),
      on_run_ended_(std::move(on_run_ended)),
      steps_(log, config.before_step),
      clock_(queue.last_event_s()),
      folders_(config.data_folder + "/jobs", files, queue, steps_, log) {
  if (config_.adopt) folders_.adopt();
  recovered_ = steps_.run("recover the jobs", [this] { recover(); });
  steps_.run("clean up the folders of jobs", [this] { folders_.clean_up(); });
  exports_ = std::make_unique<Exports>(config_, files_, queue_, config_.data_folder + "/jobs",
                                       steps_, log_);
  thread_ = std::thread([this] {
    while (!steps_.run("dispatch jobs", [this] { dispatch(); }) && !stopping()) sleep_s(kMaxSleepS);
  });
}

Dispatcher::~Dispatcher() { stop(); }

JobFolder Dispatcher::folder(const std::string& id) const { return folders_.of(id); }

bool Dispatcher::stopping() {
  std::lock_guard lock(mutex_);
  return stops_;
}

void Dispatcher::recover() {
  std::set<std::string> running;
  for (const auto& [key, worker] : workers_)
    if (worker.is_running()) running.insert(key);
  const auto pause = [this](unsigned attempt) { return pause_s(config_.jobs, attempt); };
  for (const Job& job : queue_.recover(running, pause))
    log_({"job " + job.id + " " + state_name(job.state), LogLevel::kInfo, job.id});
}

void Dispatcher::stop() {
  {
    std::lock_guard lock(mutex_);
    stops_ = true;
    for (auto& [key, worker] : workers_) worker.live->stop();
  }
  exports_->begin_stop();
  queue_.announce();
  if (thread_.joinable()) thread_.join();
  for (auto& [key, worker] : workers_)
    if (worker.thread.joinable()) worker.thread.join();
  exports_->stop();
}

void Dispatcher::dispatch() {
  for (;;) {
    const uint64_t seen = queue_.version();
    steps_.run("end the threads of jobs", [this] { join_finished(); });
    if (stopping()) return;
    steps_.run("start jobs", [this] {
      std::lock_guard lock(mutex_);
      if (stops_) return;  // no worker may start now, because nothing would stop it
      if (!recovered_) recover();
      recovered_ = true;
      start_ready_jobs();
    });
    steps_.run("finish deletions", [this] { finish_deletions(); });
    steps_.run("remove old jobs", [this] { retire_old_jobs(); });
    queue_.wait_for_change(seen, kMaxSleepS);
  }
}

void Dispatcher::join_finished() {
  std::map<std::string, Worker> finished;
  {
    std::lock_guard lock(mutex_);
    for (auto worker = workers_.begin(); worker != workers_.end();) {
      const auto next = std::next(worker);
      if (worker->second.done) finished.insert(workers_.extract(worker));
      worker = next;
    }
  }
  for (auto& [key, worker] : finished) worker.thread.join();
}

void Dispatcher::start_ready_jobs() {
  while (start_next_job()) {
  }
  if (workers_.empty()) start_preview();
}

bool Dispatcher::start_next_job() {
  uint64_t memory = 0;
  size_t running_jobs = 0;
  std::set<std::string> present = locked_;
  for (const auto& [key, worker] : workers_) {
    present.insert(key);
    memory += worker.live->memory_bytes();
    running_jobs += key != kPreview;
  }
  if (running_jobs >= config_.jobs.max_concurrent) return false;
  const auto job = queue_.next(unix_seconds(), config_.jobs.max_backoff_s, present);
  if (!job) return false;
  uint64_t needed = 0;
  std::vector<StageShare> stages;
  try {
    const JobRequest request = parse_job_request(job->request);
    needed = tasks_.memory_of(request);
    stages = long_stages(request.spec.geometry);
  } catch (const RequestError& error) {
    // The request cannot be read: another version of this program stored it, or its record is
    // damaged.
    log_({"job " + job->id + " failed: " + error.message(), LogLevel::kError, job->id});
    queue_.change(job->id, [&](Job& j) {
      j.state = JobState::kFailed;
      j.finished_s = unix_seconds();
      j.error = JobError{error.code(), error.message(), j.finished_s, false};
    });
    return true;
  }
  if (running_jobs > 0 && memory + needed > tasks_.memory_bytes()) return false;
  if (disk_.is_low()) return false;
  const Job started = queue_.change(job->id, [](Job& j) {
    if (!j.front) ++j.attempts;
    j.front = false;
    j.state = JobState::kRunning;
    if (j.started_s == 0) j.started_s = unix_seconds();
    j.not_before_s = 0;
  });
  try {
    log_({"job " + started.id + " running", LogLevel::kInfo, started.id});
    start_worker(started.id, std::make_shared<LiveJob>(needed, std::move(stages)),
                 [this, started](LiveJob& live) { run_job(started, live); });
  } catch (...) {
    recovered_ = steps_.run("queue job " + started.id + " again", [&] {
      queue_.change(started.id, [](Job& j) {
        j.state = JobState::kQueued;
        j.front = true;
      });
    });
    throw;
  }
  return true;
}

void Dispatcher::start_preview() {
  const auto job = queue_.next_without_preview();
  if (!job) return;
  start_worker(kPreview, std::make_shared<LiveJob>(0),
               [this, job = *job](LiveJob& live) { draw_preview(job, live); });
}

void Dispatcher::start_worker(const std::string& key, std::shared_ptr<LiveJob> live,
                              std::function<void(LiveJob&)> work) {
  const bool is_job = key != kPreview;
  const auto forget_live = [this, key] {
    std::lock_guard lock(live_mutex_);
    live_.erase(key);
  };
  const std::string step = (is_job ? "run job " : "run ") + key;
  const auto run = [this, key, step, live, forget_live, work = std::move(work)] {
    const bool ended = steps_.run(step, [&] { work(*live); });
    {
      std::lock_guard lock(mutex_);
      workers_.at(key).done = true;
      recovered_ = recovered_ && ended;
    }
    forget_live();
    queue_.announce();
  };
  try {
    workers_[key].live = live;
    if (is_job) {
      std::lock_guard lock(live_mutex_);
      live_[key] = live;
    }
    workers_.at(key).thread = std::thread(run);
  } catch (...) {
    forget_live();
    workers_.erase(key);
    throw;
  }
}

ChildProcess::End Dispatcher::run_process(const ChildProcess::Start& start, LiveJob& live,
                                          double max_s) {
  return run_child(start, live, config_.jobs.stop_timeout_s, max_s, [this] { queue_.announce(); });
}

void Dispatcher::run_job(const Job& job, LiveJob& live) {
  const JobFolder place = folder(job.id);
  ChildProcess::End end;
  try {
    files_.make_directories(place.path);
    write_task(files_, place.task(),
               tasks_.make(parse_job_request(job.request), JobTask::Kind::kBuild));
    end = run_process({{config_.program, "run-job", place.path}, place.log(), config_.jobs.nice},
                      live, kNoTimeLimitS);
  } catch (const std::exception& error) {
    log_({"job " + job.id + ": " + error.what(), LogLevel::kError, job.id});
    const PublicError seen = public_error(error);
    live.apply(Failure{seen.code, seen.text});
  }
  // Stored before the state changes, so that clients that wait for the end find the rates.
  steps_.run("store the rates of job " + job.id, [&] {
    if (files_.exists(place.path)) write_file_atomically(files_, place.rates(), live.rates_json());
  });
  record_outcome(job, live, end);
}

void Dispatcher::record_outcome(const Job& job, LiveJob& live, const ChildProcess::End& end) {
  // While the queue cannot be written, for example because the disk is full, the job remains
  // recorded as running. The loop repeats until the queue is writable again. If the service ends
  // first, the next service runs the job again.
  std::optional<Job> after;
  while (!steps_.run("record how job " + job.id + " ended", [&] {
    std::lock_guard lock(mutex_);
    if (!queue_.find(job.id)) return;  // the job was deleted
    after = queue_.change(
        job.id, [&](Job& j) { apply_outcome(j, live, end, config_.jobs, unix_seconds()); });
    workers_.at(job.id).recorded = true;
  })) {
    sleep_s(kMaxSleepS);
    if (stopping()) return;
  }
  if (!after) return;
  log_({"job " + job.id + " " + state_name(after->state) +
            (after->error ? ": " + after->error->code : ""),
        after->state == JobState::kFailed ? LogLevel::kError : LogLevel::kInfo, job.id});
  if (after->state == JobState::kSuspended || after->state == JobState::kFailed) stop_tasks(job.id);
  remove_work(job.id);
  on_run_ended_(*after);
}

void Dispatcher::draw_preview(const Job& job, LiveJob& live) {
  const JobFolder place = folder(job.id);
  bool drawn = false;
  steps_.run("draw a preview", [&] {
    const ChildProcess::End end =
        run_process({{config_.program, "render", place.result(), "-o", place.preview(), "--size",
                      "960x540", "--samples", "1", "--threads", "1"},
                     place.file("preview.log"),
                     config_.jobs.nice + kPreviewNice},
                    live, kMaxPreviewS);
    drawn = end.signal == 0 && end.exit_status == 0 && files_.exists(place.preview());
  });
  if (live.stop_requested_s() > 0) return;
  const bool recorded = steps_.run("record a preview", [&] {
    if (queue_.find(job.id))
      queue_.change(job.id,
                    [&](Job& j) { j.preview = drawn ? Preview::kReady : Preview::kFailed; });
  });
  if (!recorded) sleep_s(kMaxSleepS);
}

void Dispatcher::stop_tasks(const std::string& id) {
  steps_.run("stop the cluster's tasks of job " + id, [&] {
    const FilesLock lock(*this, id);
    stop_cluster_tasks(files_, folder(id).work());
  });
}

void Dispatcher::remove_work(const std::string& id) {
  steps_.run("remove the work folder of job " + id, [&] {
    const FilesLock lock(*this, id);
    const auto job = queue_.find(id);
    if (job && (job->state == JobState::kCanceled || job->state == JobState::kSucceeded))
      folders_.remove_work(id);
  });
}

void Dispatcher::retire_old_jobs() {
  const double now_s = wall_seconds();
  if (now_s < next_retirement_s_) return;
  const double oldest_s = clock_.oldest_s(config_.retention.finished_days, "job", log_);
  next_retirement_s_ = now_s + kRetireIntervalS;
  size_t removed = 0;
  for (const std::string& id : queue_.expired(oldest_s, config_.retention.finished_jobs)) {
    if (removed == kMaxRetiredPerPass) {
      next_retirement_s_ = now_s;
      break;
    }
    removed += steps_.run("remove old job " + id, [&] {
      try {
        remove(id);
        log_({"job " + id + " removed by the retention rule", LogLevel::kInfo, id});
      } catch (const RequestError&) {
        // A client has deleted or retried the job.
      }
    });
  }
}

Job Dispatcher::cancel(const std::string& id) {
  Job job;
  {
    std::lock_guard lock(mutex_);
    const auto worker = workers_.find(id);
    const bool is_running = worker != workers_.end() && worker->second.is_running();
    job = queue_.change(id, [&](Job& j) {
      if (j.state == JobState::kFailed || j.state == JobState::kSucceeded)
        throw state_conflict(j, "expected a job that has not ended");
      if (j.state == JobState::kCanceling || j.state == JobState::kCanceled) return;
      j.state = is_running ? JobState::kCanceling : JobState::kCanceled;
      if (!is_running) j.finished_s = unix_seconds();
    });
    if (is_running && job.state == JobState::kCanceling) worker->second.live->stop();
  }
  if (job.state == JobState::kCanceled) remove_work(id);
  return job;
}

Job Dispatcher::suspend(const std::string& id) {
  bool is_running = false;
  Job job;
  {
    std::lock_guard lock(mutex_);
    job = queue_.change(id, [&](Job& j) {
      if (j.state == JobState::kCanceling || has_ended(j.state))
        throw state_conflict(j, "expected a job that is queued or running");
      j.state = JobState::kSuspended;
    });
    const auto worker = workers_.find(id);
    is_running = worker != workers_.end() && worker->second.is_running();
    if (is_running) worker->second.live->stop();
  }
  // An earlier service that was killed may have left cluster tasks of this job running, even if the
  // job was queued again after that.
  if (!is_running) stop_tasks(id);
  return job;
}

Job Dispatcher::resume(const std::string& id) {
  return queue_.change(id, [&](Job& j) {
    if (j.state == JobState::kRunning) return;
    if (j.state != JobState::kQueued && j.state != JobState::kSuspended)
      throw state_conflict(j, "expected a suspended job");
    if (j.state == JobState::kSuspended) j.front = j.attempts > 0;
    j.state = JobState::kQueued;
    j.not_before_s = 0;
  });
}

Job Dispatcher::retry(const std::string& id) {
  std::lock_guard lock(mutex_);  // so that no deletion begins during the call
  return queue_.change(id, [&](Job& j) {
    if (j.state == JobState::kRunning) return;
    if (j.state != JobState::kQueued && j.state != JobState::kFailed &&
        j.state != JobState::kCanceled)
      throw state_conflict(j, "expected a job that failed or was canceled");
    j.not_before_s = 0;
    if (j.state == JobState::kQueued) return;
    if (folders_.is_marked(id))
      throw state_conflict(
          j, "the deletion of this job has begun: delete it again to finish the deletion");
    j.state = JobState::kQueued;
    j.attempts = j.interruptions = 0;
    j.front = false;
    j.started_s = j.finished_s = 0;
  });
}

void Dispatcher::remove(const std::string& id) {
  queue_.check_removable(id);
  stop_tasks(id);
  const FilesLock files_lock(*this, id);
  Exports::Pause exports(*exports_, id);
  {
    std::lock_guard lock(mutex_);  // so that the job is not retried between check and mark
    queue_.check_removable(id);
    folders_.mark(id);
  }
  exports.forget();
  try {
    folders_.remove_marked(id);
  } catch (...) {
    std::lock_guard lock(mutex_);
    next_deletions_s_ = wall_seconds() + kDeletionIntervalS;
    throw;
  }
}

void Dispatcher::finish_deletions() {
  {
    std::lock_guard lock(mutex_);
    if (wall_seconds() < next_deletions_s_) return;
    next_deletions_s_ = HUGE_VAL;
  }
  for (const std::string& id : folders_.marked()) {
    {
      std::lock_guard lock(mutex_);
      if (locked_.contains(id)) continue;  // a client is deleting it now
    }
    const bool finished = steps_.run("delete job " + id, [&] {
      const FilesLock lock(*this, id);
      folders_.finish_deletion(id);
    });
    std::lock_guard lock(mutex_);
    if (!finished) next_deletions_s_ = wall_seconds() + kDeletionIntervalS;
  }
}

std::shared_ptr<LiveJob> Dispatcher::live(const std::string& id) const {
  std::lock_guard lock(live_mutex_);
  const auto found = live_.find(id);
  return found == live_.end() ? nullptr : found->second;
}

ClusterTasks Dispatcher::cluster_tasks() const {
  ClusterTasks all;
  std::lock_guard lock(live_mutex_);
  for (const auto& [id, live] : live_) {
    const auto tasks = live->cluster_tasks();
    if (!tasks) continue;
    all.waiting += tasks->waiting;
    all.failed_attempts += tasks->failed_attempts;
    for (const auto& [node, count] : tasks->running) all.running[node] += count;
  }
  return all;
}

size_t Dispatcher::running() const {
  std::lock_guard lock(live_mutex_);
  return live_.size();
}

}  // namespace voxdag::server
