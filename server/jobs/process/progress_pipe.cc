#include "server/jobs/process/progress_pipe.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <exception>

#include "core/base/clock.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"

namespace voxdag::server {
namespace {

constexpr double kAdvanceIntervalS = 0.25;
constexpr double kSubvolumesIntervalS = 1;
// Maximum share of one core's time that is used to write subvolumes.json.
constexpr double kMaxSubvolumesShare = 0.01;

void write_all(int file, const std::string& text) {
  for (size_t at = 0; at < text.size();) {
    const ssize_t wrote = ::write(file, text.data() + at, text.size() - at);
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote <= 0) return;  // nobody is reading
    at += static_cast<size_t>(wrote);
  }
}

}  // namespace

void ProgressPipe::begin_stage(std::string_view stage, uint64_t total, std::string_view unit) {
  std::lock_guard lock(mutex_);
  stage_ = stage;
  unit_ = unit;
  done_ = 0;
  total_ = total;
  stage_start_s_ = last_advance_s_ = wall_seconds();
  send(StageBegun{stage_, unit_, total_});
}

void ProgressPipe::resume_at(uint64_t done) {
  std::lock_guard lock(mutex_);
  done_ = done;
  send(StageResumed{done});
}

void ProgressPipe::advance(uint64_t count) {
  std::lock_guard lock(mutex_);
  done_ += count;
  send_advance(false);
}

void ProgressPipe::set_total(uint64_t total) {
  std::lock_guard lock(mutex_);
  total_ = total;
  send_advance(false);
}

void ProgressPipe::end_stage() {
  std::lock_guard lock(mutex_);
  send_advance(true);
  report_subvolumes(true);
  send(StageEnded{});
  char took[32];
  std::snprintf(took, sizeof took, "%.2f s", wall_seconds() - stage_start_s_);
  log(stage_ + ": " + std::to_string(done_) + " " + unit_ + " in " + took);
}

void ProgressPipe::warn(std::string_view message) {
  warn_of_input({.code = "build", .place = "", .message = std::string(message)});
}

void ProgressPipe::warn_of_input(const Warning& warning) {
  std::lock_guard lock(mutex_);
  send(WarningReported{warning});
  log("warning: " + warning.text());
}

void ProgressPipe::set_subvolumes(uint64_t resolution, std::span<const SubvolumeStatus> all) {
  std::lock_guard lock(mutex_);
  subvolumes_.set(resolution, all);
  subvolumes_changed_ = !all.empty();
  report_subvolumes(true);
  next_subvolumes_s_ = 0;  // so that the first begun subvolume is reported without delay
  if (!ticker_.joinable())
    ticker_ = std::jthread([this](const std::stop_token& end) { tick(end); });
}

void ProgressPipe::set_grid(const std::array<double, 3>& origin, double edge) {
  std::lock_guard lock(mutex_);
  subvolumes_.set_grid(origin, edge);
}

void ProgressPipe::subvolume_begun(int64_t id) {
  std::lock_guard lock(mutex_);
  subvolumes_.begun(id);
  subvolumes_changed_ = true;
  report_subvolumes(false);
}

void ProgressPipe::subvolume_built(const SubvolumeStatus& built) {
  std::lock_guard lock(mutex_);
  subvolumes_.built(built);
  subvolumes_changed_ = true;
  report_subvolumes(false);
}

void ProgressPipe::subvolume_split(int64_t id, std::span<const SubvolumeStatus> parts) {
  std::lock_guard lock(mutex_);
  subvolumes_.split(id, parts);
  subvolumes_changed_ = true;
  report_subvolumes(false);
}

void ProgressPipe::set_usage(uint64_t memory_bytes, uint64_t disk_bytes) {
  std::lock_guard lock(mutex_);
  send(Usage{memory_bytes, disk_bytes});
}

void ProgressPipe::set_cluster_tasks(const ClusterTasks& tasks) {
  std::lock_guard lock(mutex_);
  send(tasks);
}

void ProgressPipe::fail(const std::string& code, const std::string& text) {
  std::lock_guard lock(mutex_);
  subvolumes_.stop();
  subvolumes_changed_ = subvolumes_.totals().total > 0;
  report_subvolumes(true);
  send(Failure{code, text});
  log((code == "canceled" ? "stopped: " : "error: ") + text);
}

void ProgressPipe::finish(const std::string& result_json) {
  std::lock_guard lock(mutex_);
  send(Result{result_json});
  log("done");
}

void ProgressPipe::send(const Message& message) {
  write_all(STDOUT_FILENO, encode(message) + "\n");
}

void ProgressPipe::send_advance(bool now) {
  const double time_s = wall_seconds();
  if (!now && time_s - last_advance_s_ < kAdvanceIntervalS) return;
  last_advance_s_ = time_s;
  send(StageAdvanced{done_, total_});
}

void ProgressPipe::report_subvolumes(bool now) {
  if (!subvolumes_changed_ || (!now && wall_seconds() < next_subvolumes_s_)) return;
  subvolumes_changed_ = false;
  const double start_s = thread_cpu_seconds();
  write_subvolumes();
  send(subvolumes_.totals());  // after the file, which clients request when they see the totals
  const double pause_s = (thread_cpu_seconds() - start_s) / kMaxSubvolumesShare;
  next_subvolumes_s_ = wall_seconds() + std::max(kSubvolumesIntervalS, pause_s);
}

void ProgressPipe::tick(const std::stop_token& end) {
  std::unique_lock lock(mutex_);
  while (!end.stop_requested()) {
    ticks_.wait_for(lock, end, std::chrono::duration<double>(kSubvolumesIntervalS),
                    [] { return false; });
    report_subvolumes(false);
  }
}

void ProgressPipe::write_subvolumes() {
  const std::string temporary = subvolumes_path_ + ".new";
  try {
    const std::string text = subvolumes_.json();
    const auto file = files_.create(temporary);
    file->write_at(0, std::as_bytes(std::span(text)));
    file->close();
    files_.rename(temporary, subvolumes_path_);
  } catch (const std::exception&) {
    // Ignores all exceptions, because nothing catches them in tick(). The next call may succeed,
    // even after a lack of memory.
  }
}

void ProgressPipe::log(const std::string& text) {
  write_all(STDERR_FILENO,
            utc_text(time(nullptr), "%Y-%m-%dT%H:%M:%SZ ") + printable_line(text) + "\n");
}

}  // namespace voxdag::server
