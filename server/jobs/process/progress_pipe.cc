#include "server/jobs/process/progress_pipe.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <ctime>

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

constexpr double kInterval_s = 0.25;

void write_all(int file, const std::string& text) {
  for (size_t at = 0; at < text.size();) {
    const ssize_t wrote = ::write(file, text.data() + at, text.size() - at);
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote <= 0) return;  // nobody reads any more
    at += static_cast<size_t>(wrote);
  }
}

}  // namespace

void ProgressPipe::hide(std::vector<std::pair<std::string, std::string>> texts) {
  std::lock_guard lock(mutex_);
  hidden_ = std::move(texts);
}

void ProgressPipe::begin_stage(std::string_view stage, uint64_t total, std::string_view unit) {
  std::lock_guard lock(mutex_);
  stage_ = stage;
  unit_ = unit;
  done_ = 0;
  total_ = total;
  stage_start_s_ = last_sent_s_ = wall_seconds();
  Report report;
  report.kind = Report::Kind::kStage;
  report.text = stage_;
  report.unit = unit_;
  report.total = total_;
  send(report);
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
  Report report;
  report.kind = Report::Kind::kEnd;
  send(report);
  char took[32];
  std::snprintf(took, sizeof took, "%.2f s", wall_seconds() - stage_start_s_);
  log(stage_ + ": " + std::to_string(done_) + " " + unit_ + " in " + took);
}

void ProgressPipe::warn(std::string_view message) {
  std::lock_guard lock(mutex_);
  Report report;
  report.kind = Report::Kind::kWarning;
  report.text = hidden(std::string(message));
  send(report);
  log("warning: " + report.text);
}

void ProgressPipe::built(const Report& report) {
  std::lock_guard lock(mutex_);
  send(report);
}

void ProgressPipe::fail(const std::string& code, const std::string& message) {
  std::lock_guard lock(mutex_);
  Report report;
  report.kind = Report::Kind::kError;
  report.code = code;
  report.text = hidden(message);
  send(report);
  log((code == "canceled" ? "stopped: " : "error: ") + report.text);
}

void ProgressPipe::finish(const std::string& result) {
  std::lock_guard lock(mutex_);
  Report report;
  report.kind = Report::Kind::kResult;
  report.text = result;
  send(report);
  log("done");
}

void ProgressPipe::send(const Report& report) {
  write_all(STDOUT_FILENO, report_line(report) + "\n");
}

void ProgressPipe::send_advance(bool at_once) {
  const double now = wall_seconds();
  if (!at_once && now - last_sent_s_ < kInterval_s) return;
  last_sent_s_ = now;
  Report report;
  report.kind = Report::Kind::kAdvance;
  report.done = done_;
  report.total = total_;
  send(report);
}

void ProgressPipe::log(const std::string& text) {
  const time_t now = time(nullptr);
  tm parts{};
  gmtime_r(&now, &parts);
  char stamp[32];
  strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%SZ ", &parts);
  write_all(STDERR_FILENO, stamp + text + "\n");
}

std::string ProgressPipe::hidden(std::string text) const {
  for (const auto& [from, to] : hidden_)
    for (size_t at = text.find(from); !from.empty() && at != std::string::npos;
         at = text.find(from, at + to.size()))
      text.replace(at, from.size(), to);
  return text;
}

}  // namespace voxdag::server
