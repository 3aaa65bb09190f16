#include "server/jobs/exports.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <tuple>

#include "core/base/clock.h"
#include "core/base/process_limits.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "core/io/random_id.h"
#include "server/jobs/process/export_process.h"
#include "server/jobs/run_child.h"

namespace voxdag::server {
namespace {

constexpr const char* kExportsFolder = "exports";
constexpr const char* kExportRecord = "export.json";
constexpr uint64_t kMaxRecordBytes = uint64_t{1} << 20;
constexpr size_t kMaxQueuedExports = 256;
constexpr double kNoExportLimitS = 1e9;
// An export fails if more than this number of its consecutive runs ended because the service ended.
constexpr unsigned kMaxExportInterruptions = 3;
constexpr const char* kExpectedRetry =
    ": send the request again, and report the defect if it fails again";

void set_error(Export& it, const std::string& code, const std::string& message) {
  it.state = ExportState::kFailed;
  it.finished_s = unix_seconds();
  it.error_code = code;
  it.error_message = message;
}

void queue_again(Export& it) {
  it.state = ExportState::kQueued;
  it.started_s = it.finished_s = 0;
  it.error_code.clear();
  it.error_message.clear();
  it.result = {};
}

// Returns the entry of an export. Throws RequestError{kNotFound}.
auto& entry_in(auto& jobs, const std::string& job, const std::string& id) {
  const auto entries = jobs.find(job);
  if (entries != jobs.end())
    if (const auto found = entries->second.find(id); found != entries->second.end())
      return found->second;
  throw RequestError(RequestError::Kind::kNotFound,
                     "no export " + id.substr(0, 32) + ": expected the id of an export of the job");
}

// Returns the result that the process of the export has reported. Throws Error{kCorrupt} for a
// result that no export has.
ExportResult result_of(const Export& it, const LiveJob& live) {
  auto result = record_from_text<ExportResult>(live.result(), "the result of an export");
  bool is_valid = !result.files.empty() && result.files[0].name == it.output;
  for (const ExportedFile& file : result.files)
    is_valid = is_valid && file.name.find('/') == std::string::npos && file.sha256.size() == 64;
  if (!is_valid) throw Error(ErrorCode::kCorrupt, "the result of an export names other files");
  return result;
}

// Sets the state of an export whose process has ended.
void apply_export_outcome(Export& it, const LiveJob& live, const ChildProcess::End& end) {
  if (it.state == ExportState::kDeleting) return;
  it.interruptions = 0;
  if (!live.result().empty()) {
    it.result = result_of(it, live);
    it.state = ExportState::kSucceeded;
    it.finished_s = unix_seconds();
  } else if (live.stop_requested_s() > 0) {
    queue_again(it);
  } else if (const auto failure = live.failure()) {
    set_error(it, failure->code, failure->text);
  } else if (end.signal == SIGKILL) {
    set_error(it, "out_of_memory",
              "the process of the export was killed, perhaps by the system because memory ran out: "
              "expected more free memory, or a smaller exports.memory of the service");
  } else if (end.signal != 0) {
    set_error(it, "internal",
              "the process of the export crashed (signal " + std::to_string(end.signal) + ")" +
                  kExpectedRetry);
  } else {
    set_error(it, "internal",
              "the process of the export ended with status " + std::to_string(end.exit_status) +
                  " and reported neither a result nor a failure" + kExpectedRetry);
  }
}

}  // namespace

Exports::Exports(const ServerConfig& config, FileSystem& files, JobQueue& queue,
                 std::string jobs_path, Steps& steps, Log log)
    : config_(config),
      files_(files),
      queue_(queue),
      jobs_path_(std::move(jobs_path)),
      steps_(steps),
      log_(std::move(log)),
      memory_bytes_(config.exports.memory_bytes ? config.exports.memory_bytes
                                                : std::max(kMinMemory, default_memory() / 2)) {
  steps_.run("load the exports", [&] {
    for (const DirectoryEntry& entry : files_.list(jobs_path_))
      if (entry.is_directory && is_random_id(entry.name) && queue_.find(entry.name))
        steps_.run("load the exports of job " + entry.name, [&] { load(entry.name); });
  });
  thread_ = std::thread([this] {
    while (!steps_.run("run exports", [this] { run(); })) {
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, std::chrono::seconds(1), [&] { return stops_; });
    }
  });
}

Exports::~Exports() { stop(); }

std::string Exports::folder(const Export& it) const {
  return jobs_path_ + "/" + it.job + "/" + kExportsFolder + "/" + it.id;
}

std::string Exports::path(const Export& it, const std::string& file) const {
  return folder(it) + "/" + file;
}

void Exports::load(const std::string& job) {
  const std::string all = jobs_path_ + "/" + job + "/" + kExportsFolder;
  if (!files_.exists(all)) return;
  for (const DirectoryEntry& entry : files_.list(all))
    if (entry.is_directory && is_random_id(entry.name))
      steps_.run("load export " + entry.name + " of job " + job,
                 [&] { load_one(job, entry.name); });
}

void Exports::load_one(const std::string& job, const std::string& id) {
  Export it;
  it.job = job;
  it.id = id;
  const std::string record = path(it, kExportRecord);
  if (!files_.exists(record)) return remove_tree(files_, folder(it));
  it = record_from_text<Export>(read_own_file(files_, record, kMaxRecordBytes), record);
  it.job = job;
  it.id = id;
  if (it.state == ExportState::kDeleting) return remove_folder(it);
  if (it.state == ExportState::kRunning) {
    clear(it);
    const unsigned interruptions = it.interruptions + 1;
    queue_again(it);
    it.interruptions = interruptions;
    if (interruptions > kMaxExportInterruptions)
      set_error(it, "internal",
                "the service ended " + std::to_string(interruptions) +
                    " times while this export ran, perhaps because of it");
    write_record(it);
  }
  jobs_[job][id] = {it, false, nullptr};
  next_turn_ = std::max(next_turn_, it.turn.value_or(0) + 1);
}

void Exports::write_record(const Export& it) {
  write_file_atomically(files_, path(it, kExportRecord), json_text(record_json(it)));
}

void Exports::clear(const Export& it) {
  for (const DirectoryEntry& entry : files_.list(folder(it))) {
    if (entry.name == kExportRecord || entry.name == JobFolder().log()) continue;
    if (entry.is_directory)
      remove_tree(files_, path(it, entry.name));
    else
      files_.remove(path(it, entry.name));
  }
}

void Exports::remove_folder(const Export& it) {
  // Removes the record first: without it, the rest of an interrupted removal does not count as an
  // export.
  if (files_.exists(path(it, kExportRecord))) files_.remove(path(it, kExportRecord));
  remove_tree(files_, folder(it));
}

void Exports::begin_stop() {
  std::lock_guard lock(mutex_);
  stops_ = true;
  for (auto& [job, entries] : jobs_)
    for (auto& [id, entry] : entries)
      if (entry.live) entry.live->stop();
  changed_.notify_all();
}

void Exports::stop() {
  begin_stop();
  if (thread_.joinable()) thread_.join();
}

void Exports::check_not_paused(const std::string& job) const {
  if (paused_.contains(job))
    throw RequestError(RequestError::Kind::kConflict,
                       "the job is being deleted: expected a job that is kept");
}

Exports::Added Exports::add(const std::string& job, const std::string& request,
                            const std::string& output) {
  std::lock_guard lock(mutex_);
  check_not_paused(job);
  if (!files_.exists(JobFolder{jobs_path_ + "/" + job}.result()))
    throw RequestError(RequestError::Kind::kConflict,
                       "the result of the job is missing, because its deletion has begun");
  Export it;
  Entry* known = nullptr;
  size_t queued = 0;
  for (auto& [other_job, entries] : jobs_)
    for (auto& [id, other] : entries) {
      queued += other.it.state == ExportState::kQueued;
      if (other_job == job && other.it.request == request) known = &other;
    }
  if (known && known->it.state == ExportState::kDeleting)
    throw RequestError(RequestError::Kind::kConflict,
                       "the export with this request is being deleted: send the request again "
                       "when it is deleted");
  if (known && known->it.state != ExportState::kFailed) return {known->it, false};
  const size_t count = jobs_.contains(job) ? jobs_.at(job).size() : 0;
  if (!known && count >= config_.exports.max_per_job)
    throw RequestError(RequestError::Kind::kLimit,
                       "the job has " + std::to_string(count) +
                           " exports, the limit exports.max_per_job of the service: delete one of "
                           "them first");
  if (queued >= kMaxQueuedExports)
    throw RequestError(
        RequestError::Kind::kBusy,
        "too many exports are queued: expected fewer than " + std::to_string(kMaxQueuedExports));
  if (known) {
    it = known->it;
  } else {
    it.id = random_id();
    it.job = job;
    it.request = request;
    it.output = output;
    it.created_s = unix_seconds();
  }
  queue_again(it);
  it.interruptions = 0;
  it.turn = next_turn_++;
  files_.make_directories(folder(it));
  try {
    write_record(it);
  } catch (...) {
    if (!known) steps_.run("remove an export", [&] { remove_folder(it); });
    throw;
  }
  // An export that has just failed can still be busy. It remains so until its files are removed.
  Entry& entry = known ? *known : jobs_[job][it.id];
  entry.it = it;
  changed_.notify_all();
  return {it, true};
}

std::vector<Export> Exports::list(const std::string& job) const {
  std::vector<Export> all;
  {
    std::lock_guard lock(mutex_);
    const auto found = jobs_.find(job);
    if (found == jobs_.end()) return all;
    for (const auto& [id, entry] : found->second) all.push_back(entry.it);
  }
  std::ranges::sort(all, [](const Export& a, const Export& b) {
    return std::tie(a.created_s, a.id) < std::tie(b.created_s, b.id);
  });
  return all;
}

Export Exports::find(const std::string& job, const std::string& id) const {
  std::lock_guard lock(mutex_);
  return entry_in(jobs_, job, id).it;
}

Exports::Statistics Exports::statistics() const {
  std::lock_guard lock(mutex_);
  Statistics statistics = ended_;
  for (const auto& [job, entries] : jobs_)
    for (const auto& [id, entry] : entries)
      ++statistics.exports[static_cast<size_t>(entry.it.state)];
  return statistics;
}

std::shared_ptr<LiveJob> Exports::live(const std::string& id) const {
  std::lock_guard lock(mutex_);
  for (const auto& [job, entries] : jobs_)
    if (const auto found = entries.find(id); found != entries.end()) return found->second.live;
  return nullptr;
}

bool Exports::remove(const std::string& job, const std::string& id) {
  std::unique_lock lock(mutex_);
  Entry& entry = entry_in(jobs_, job, id);
  check_not_paused(job);
  if (entry.is_busy) {
    if (entry.it.state == ExportState::kDeleting) return false;
    Export deleting = entry.it;
    deleting.state = ExportState::kDeleting;
    write_record(deleting);
    entry.it = deleting;
    if (entry.live) entry.live->stop();
    return false;
  }
  entry.it.state = ExportState::kDeleting;
  entry.is_busy = true;
  remove_busy(entry, lock);
  return true;
}

void Exports::remove_busy(Entry& entry, std::unique_lock<std::mutex>& lock) {
  const Export it = entry.it;
  lock.unlock();
  try {
    remove_folder(it);
    log_({"export " + it.id + " of job " + it.job + " deleted", LogLevel::kInfo, it.job});
  } catch (...) {
    lock.lock();
    entry.is_busy = false;  // the next request to delete it tries again
    changed_.notify_all();
    throw;
  }
  lock.lock();
  const auto entries = jobs_.find(it.job);
  entries->second.erase(it.id);
  if (entries->second.empty()) jobs_.erase(entries);
  changed_.notify_all();
}

Exports::Entry* Exports::next_ready() {
  Entry* next = nullptr;
  for (auto& [job, entries] : jobs_) {
    if (paused_.contains(job)) continue;
    for (auto& [id, entry] : entries)
      if (entry.it.state == ExportState::kQueued && (!next || entry.it.turn < next->it.turn))
        next = &entry;
  }
  return next;
}

void Exports::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    Entry* next = nullptr;
    changed_.wait(lock, [&] { return stops_ || (next = next_ready()); });
    if (stops_) return;
    try {
      run_one(*next, lock);
    } catch (...) {
      if (!lock.owns_lock()) lock.lock();
      next->live.reset();
      next->is_busy = false;
      set_error(next->it, "internal", std::string("running the export failed") + kExpectedRetry);
      changed_.notify_all();
      throw;
    }
  }
}

void Exports::run_one(Entry& entry, std::unique_lock<std::mutex>& lock) {
  const auto live = std::make_shared<LiveJob>(memory_bytes_);
  const double start_s = wall_seconds();
  entry.live = live;
  entry.is_busy = true;
  entry.it.state = ExportState::kRunning;
  entry.it.started_s = unix_seconds();
  const Export it = entry.it;
  ChildProcess::End end;
  const bool is_recorded =
      steps_.run("record the start of export " + it.id, [&] { write_record(it); });
  lock.unlock();
  log_({"export " + it.id + " of job " + it.job + " running", LogLevel::kInfo, it.job});
  try {
    if (!is_recorded)
      throw Error(ErrorCode::kIo,
                  "the start of the export could not be recorded in its folder (the log has the "
                  "reason): expected a writable folder of the job");
    end = run_process(it, *live);
  } catch (const std::exception& error) {
    log_({"export " + it.id + " of job " + it.job + ": " + error.what(), LogLevel::kError, it.job});
    const PublicError seen = public_error(error);
    live->apply(Failure{seen.code, seen.text});
  }
  lock.lock();
  entry.live.reset();
  try {
    apply_export_outcome(entry.it, *live, end);
  } catch (const Error& error) {
    set_error(entry.it, error_name(error.code()), error.message());
  }
  finish(entry, wall_seconds() - start_s, lock);
}

ChildProcess::End Exports::run_process(const Export& it, LiveJob& live) {
  clear(it);  // an earlier attempt may have been killed
  JobTask task;
  task.kind = JobTask::Kind::kExport;
  task.request = it.request;
  task.uploads = {{kExportInput, "../../" + JobFolder().result()}};
  task.memory_bytes = memory_bytes_;
  task.threads = config_.jobs.threads;
  task.min_free_bytes = config_.jobs.min_free_disk_bytes;
  task.output = it.output;
  write_task(files_, JobFolder{folder(it)}.task(), task);
  return run_child(
      {{config_.program, "run-job", folder(it)}, JobFolder{folder(it)}.log(), config_.jobs.nice},
      live, config_.jobs.stop_timeout_s, kNoExportLimitS, [] {});
}

void Exports::finish(Entry& entry, double wall_s, std::unique_lock<std::mutex>& lock) {
  const Export it = entry.it;
  log_({"export " + it.id + " of job " + it.job + " " + name_of(it.state) +
            (it.error_code.empty() ? "" : ": " + it.error_code),
        it.error_code.empty() ? LogLevel::kInfo : LogLevel::kError, it.job});
  ++ended_.ended_runs[static_cast<size_t>(it.state)];
  for (const ExportedFile& file : it.result.files) ended_.ended_bytes += file.bytes;
  ended_.ended_wall_s += wall_s;
  if (it.state == ExportState::kFailed || it.state == ExportState::kQueued) {
    lock.unlock();
    steps_.run("remove the files of export " + it.id, [&] { clear(it); });
    lock.lock();
  }
  if (entry.it.state == ExportState::kDeleting) {  // a request has deleted it, perhaps just now
    if (steps_.run("delete export " + it.id, [&] { remove_busy(entry, lock); })) return;
  } else {
    // If the record cannot be written, the export runs again when the service starts again.
    steps_.run("record the end of export " + it.id, [&] { write_record(entry.it); });
  }
  entry.is_busy = false;
  changed_.notify_all();
}

Exports::Pause::Pause(Exports& exports, const std::string& job) : exports_(exports), job_(job) {
  std::unique_lock lock(exports_.mutex_);
  exports_.paused_.insert(job_);
  const auto is_idle = [&] {
    const auto found = exports_.jobs_.find(job_);
    return found == exports_.jobs_.end() ||
           std::ranges::none_of(found->second,
                                [](const auto& item) { return item.second.is_busy; });
  };
  if (const auto found = exports_.jobs_.find(job_); found != exports_.jobs_.end())
    for (auto& [id, entry] : found->second)
      if (entry.live) entry.live->stop();
  exports_.changed_.wait(lock, is_idle);
}

Exports::Pause::~Pause() {
  {
    std::lock_guard lock(exports_.mutex_);
    exports_.paused_.erase(job_);
  }
  exports_.changed_.notify_all();
}

void Exports::Pause::forget() {
  std::lock_guard lock(exports_.mutex_);
  exports_.jobs_.erase(job_);
}

}  // namespace voxdag::server
