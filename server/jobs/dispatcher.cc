#include "server/jobs/dispatcher.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <system_error>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "server/jobs/job_outcome.h"

namespace voxdag::server {
namespace {

constexpr const char* kPreview = "preview";
constexpr double kMaxPreview_s = 900;
constexpr int kPreviewNice = 5;  // on top of the builds'
constexpr double kMaxSleep_s = 1;
constexpr double kNoTimeLimit_s = 1e9;
constexpr double kRetireInterval_s = 300;
constexpr double kSecondsPerDay = 86400;

}  // namespace

Dispatcher::Dispatcher(const ServerConfig& config, FileSystem& files, JobQueue& queue,
                       TaskResolver& tasks, Log log, OnRunEnded on_run_ended)
    : config_(config),
      files_(files),
      queue_(queue),
      tasks_(tasks),
      log_(std::move(log)),
      on_run_ended_(std::move(on_run_ended)) {
  files_.make_directories(config_.data_folder + "/jobs");
  for (const Job& job : queue_.recover()) log_("job " + job.id + " canceled");
  clean_up_folders();
  thread_ = std::thread([this] { dispatch(); });
}

Dispatcher::~Dispatcher() { stop(); }

JobFolder Dispatcher::folder(const std::string& id) const {
  return {config_.data_folder + "/jobs/" + id};
}

// Deleting a job removes its row first, and canceling one changes its state first. What a crash
// then left of its files is removed here.
void Dispatcher::clean_up_folders() {
  for (const DirectoryEntry& entry : files_.list(config_.data_folder + "/jobs")) {
    const auto job = queue_.find(entry.name);
    if (!job)
      remove_tree(files_, folder(entry.name).path);
    else if (has_ended(job->state) && job->state != JobState::kFailed)
      remove_tree(files_, folder(entry.name).work());
  }
}

void Dispatcher::stop() {
  {
    std::lock_guard lock(mutex_);
    stops_ = true;
    for (auto& [key, worker] : workers_) worker.live->stop();
  }
  queue_.announce();
  if (thread_.joinable()) thread_.join();
  for (auto& [key, worker] : workers_)
    if (worker.thread.joinable()) worker.thread.join();
}

void Dispatcher::dispatch() {
  for (;;) {
    const uint64_t seen = queue_.version();
    join_finished();
    try {
      std::lock_guard lock(mutex_);
      if (stops_) return;
      start_ready_jobs();
    } catch (const Error& error) {
      log_("cannot start jobs: " + error.message());
    }
    try {
      retire_old_jobs();
    } catch (const Error& error) {
      log_("cannot remove old jobs: " + error.message());
    }
    queue_.wait_for_change(seen, kMaxSleep_s);
  }
}

void Dispatcher::join_finished() {
  std::vector<std::thread> finished;
  {
    std::lock_guard lock(mutex_);
    for (auto worker = workers_.begin(); worker != workers_.end();) {
      if (worker->second.done) {
        finished.push_back(std::move(worker->second.thread));
        worker = workers_.erase(worker);
      } else {
        ++worker;
      }
    }
  }
  for (std::thread& thread : finished) thread.join();
}

void Dispatcher::start_ready_jobs() {
  while (start_next_job()) {
  }
  if (workers_.empty()) start_preview();
}

bool Dispatcher::start_next_job() {
  uint64_t memory = 0;
  size_t running_jobs = 0;
  std::set<std::string> present;
  for (const auto& [key, worker] : workers_) {
    present.insert(key);
    memory += worker.live->memory_bytes();
    running_jobs += key != kPreview;
  }
  if (running_jobs >= config_.jobs.max_concurrent) return false;
  const auto job = queue_.next(unix_seconds(), present);
  if (!job) return false;
  const uint64_t needed = tasks_.memory_of(parse_job_request(job->request));
  if (running_jobs > 0 && memory + needed > tasks_.memory_bytes()) return false;
  if (files_.free_space(config_.data_folder) < config_.jobs.min_free_disk_bytes) return false;
  const Job started = queue_.change(job->id, [](Job& j) {
    if (!j.front) ++j.attempts;
    j.front = false;
    j.state = JobState::kRunning;
    if (j.started_s == 0) j.started_s = unix_seconds();
    j.not_before_s = 0;
  });
  log_("job " + started.id + " running");
  try {
    start_worker(started.id, std::make_shared<LiveJob>(needed),
                 [this, started](LiveJob& live) { run_job(started, live); });
  } catch (const Error&) {
    queue_.change(started.id, [](Job& j) {
      j.state = JobState::kQueued;
      j.front = true;
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
  workers_[key].live = live;
  const bool is_job = key != kPreview;
  if (is_job) {
    std::lock_guard lock(live_mutex_);
    live_[key] = live;
  }
  const auto run = [this, key, is_job, live, work = std::move(work)] {
    work(*live);
    {
      std::lock_guard lock(mutex_);
      workers_.at(key).done = true;
    }
    if (is_job) {
      std::lock_guard lock(live_mutex_);
      live_.erase(key);
    }
    queue_.announce();
  };
  try {
    workers_.at(key).thread = std::thread(run);
  } catch (const std::system_error&) {
    std::lock_guard lock(live_mutex_);
    live_.erase(key);
    workers_.erase(key);
    throw Error(ErrorCode::kOutOfMemory, "no thread for " + key);
  }
}

ChildProcess::End Dispatcher::run_child(const ChildProcess::Start& start, LiveJob& live,
                                        double max_s) {
  ChildProcess child(start);
  bool stop_sent = false;
  const double started_s = wall_seconds();
  child.read_lines(
      [&](std::string_view line) {
        const auto message = decode(line);
        if (!message) return;
        live.apply(*message);
        queue_.announce();
      },
      [&] {
        const double stop_s = live.stop_requested_s(), now = wall_seconds();
        if (stop_s > 0 && !stop_sent) child.ask_to_stop();
        stop_sent = stop_s > 0;
        return (stop_sent && now > stop_s + config_.jobs.stop_timeout_s) || now > started_s + max_s;
      });
  return child.wait();
}

void Dispatcher::run_job(const Job& job, LiveJob& live) {
  const JobFolder place = folder(job.id);
  ChildProcess::End end;
  try {
    files_.make_directories(place.path);
    write_task(files_, place.task(),
               tasks_.make(parse_job_request(job.request), Task::Kind::kBuild));
    end = run_child({{config_.program, "run-job", place.path}, place.log(), config_.jobs.nice},
                    live, kNoTimeLimit_s);
  } catch (const RequestError& error) {
    live.apply(Failure{error.code(), error.message()});
  } catch (const Error& error) {
    log_("job " + job.id + ": " + error.message());
    live.apply(Failure{error_name(error.code()), public_text(error.code())});
  }
  record_outcome(job, live, end);
}

void Dispatcher::record_outcome(const Job& job, LiveJob& live, const ChildProcess::End& end) {
  for (;;) {
    try {
      std::lock_guard lock(mutex_);
      const Job after = queue_.change(
          job.id, [&](Job& j) { apply_outcome(j, live, end, config_.jobs, unix_seconds()); });
      if (after.state == JobState::kCanceled || after.state == JobState::kSucceeded)
        remove_tree(files_, folder(job.id).work());
      log_("job " + job.id + " " + state_name(after.state) +
           (after.error ? ": " + after.error->code : ""));
      on_run_ended_(after);
      return;
    } catch (const RequestError&) {
      return;  // it was deleted
    } catch (const Error& error) {
      // The queue cannot be written, perhaps because the disk is full. The job counts as running
      // until it can, or until the service ends and the next one runs the job again.
      log_("job " + job.id + ": its outcome cannot be recorded: " + error.message());
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(kMaxSleep_s));
    std::lock_guard lock(mutex_);
    if (stops_) return;
  }
}

void Dispatcher::draw_preview(const Job& job, LiveJob& live) {
  const JobFolder place = folder(job.id);
  try {
    const ChildProcess::End end =
        run_child({{config_.program, "render", place.result(), "-o", place.preview(), "--size",
                    "960x540", "--samples", "1", "--threads", "1"},
                   place.file("preview.log"),
                   config_.jobs.nice + kPreviewNice},
                  live, kMaxPreview_s);
    if (live.stop_requested_s() > 0) return;
    const bool drawn = end.signal == 0 && end.exit_status == 0 && files_.exists(place.preview());
    queue_.change(job.id, [&](Job& j) { j.preview = drawn ? Preview::kReady : Preview::kFailed; });
  } catch (const RequestError&) {
    // The job was deleted while its preview was drawn.
  } catch (const Error& error) {
    log_("preview of job " + job.id + ": " + error.message());
    std::this_thread::sleep_for(std::chrono::duration<double>(kMaxSleep_s));
  }
}

void Dispatcher::retire_old_jobs() {
  if (last_retired_s_ > 0 && wall_seconds() < last_retired_s_ + kRetireInterval_s) return;
  last_retired_s_ = wall_seconds();
  const Retention& rule = config_.retention;
  for (const std::string& id :
       queue_.expired(unix_seconds() - rule.finished_days * kSecondsPerDay, rule.finished_jobs)) {
    try {
      remove(id);
      log_("job " + id + " removed by the retention rule");
    } catch (const RequestError&) {
      // A client has deleted it or tried it again.
    }
  }
}

Job Dispatcher::cancel(const std::string& id) {
  std::lock_guard lock(mutex_);
  const auto worker = workers_.find(id);
  const bool runs = worker != workers_.end() && !worker->second.done;
  const Job job = queue_.change(id, [&](Job& j) {
    if (j.state == JobState::kFailed || j.state == JobState::kSucceeded)
      throw state_conflict(j, "the job has ended");
    if (j.state == JobState::kCanceling || j.state == JobState::kCanceled) return;
    j.state = runs ? JobState::kCanceling : JobState::kCanceled;
    if (!runs) j.finished_s = unix_seconds();
  });
  if (runs && job.state == JobState::kCanceling) worker->second.live->stop();
  if (job.state == JobState::kCanceled) remove_tree(files_, folder(id).work());
  return job;
}

Job Dispatcher::suspend(const std::string& id) {
  std::lock_guard lock(mutex_);
  const Job job = queue_.change(id, [&](Job& j) {
    if (j.state == JobState::kCanceling || has_ended(j.state))
      throw state_conflict(j, "expected a job that is queued or running");
    j.state = JobState::kSuspended;
  });
  const auto worker = workers_.find(id);
  if (worker != workers_.end()) worker->second.live->stop();
  return job;
}

Job Dispatcher::resume(const std::string& id) {
  return queue_.change(id, [&](Job& j) {
    if (j.state == JobState::kQueued || j.state == JobState::kRunning) return;
    if (j.state != JobState::kSuspended) throw state_conflict(j, "expected a suspended job");
    j.state = JobState::kQueued;
    j.front = j.attempts > 0;
    j.not_before_s = 0;
  });
}

Job Dispatcher::retry(const std::string& id) {
  return queue_.change(id, [&](Job& j) {
    if (j.state == JobState::kQueued || j.state == JobState::kRunning) return;
    if (j.state != JobState::kFailed && j.state != JobState::kCanceled)
      throw state_conflict(j, "expected a job that failed or was canceled");
    j.state = JobState::kQueued;
    j.attempts = 0;
    j.front = false;
    j.not_before_s = j.started_s = j.finished_s = 0;
  });
}

void Dispatcher::remove(const std::string& id) {
  std::lock_guard lock(mutex_);
  queue_.remove(id);
  remove_tree(files_, folder(id).path);
}

std::shared_ptr<LiveJob> Dispatcher::live(const std::string& id) const {
  std::lock_guard lock(live_mutex_);
  const auto found = live_.find(id);
  return found == live_.end() ? nullptr : found->second;
}

size_t Dispatcher::running() const {
  std::lock_guard lock(live_mutex_);
  return live_.size();
}

}  // namespace voxdag::server
