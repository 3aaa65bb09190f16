#include "cli/terminal/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <string>

#include "core/base/clock.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"

namespace voxdag::cli {
namespace {

constexpr double kTerminalInterval_s = 0.1;
constexpr double kPlainInterval_s = 5;
constexpr int kBarWidth = 24;
constexpr size_t kNameWidth = 11;
constexpr const char* kClearLine = "\r\033[K";

// Returns a count with a unit prefix and two decimals: 1234567 becomes "1.23 M". A count below 1000
// is rounded to a whole number and has no prefix.
std::string short_count(double count) {
  const char* suffix = "";
  for (const char* larger : {"k", "M", "G", "T"}) {
    if (count < 1000) break;
    count /= 1000;
    suffix = larger;
  }
  char text[32];
  std::snprintf(text, sizeof text, *suffix ? "%.2f %s" : "%.0f%s", count, suffix);
  return text;
}

std::string bar(double part) {
  const auto full = static_cast<size_t>(std::floor(part * kBarWidth));
  return "[" + std::string(full, '#') + std::string(kBarWidth - full, '.') + "] ";
}

std::string percent(double part) {
  char text[16];
  std::snprintf(text, sizeof text, "%3.0f %%  ", 100 * part);
  return text;
}

// Fraction of a stage's work that must be done before the remaining time is estimated.
constexpr double kMinPartForEstimate = 0.01;

class ProgressBar : public Progress {
 public:
  explicit ProgressBar(bool quiet) : line_(quiet) {}

  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override {
    std::lock_guard lock(mutex_);
    stage_ = stage;
    unit_ = unit;
    total_ = total;
    done_ = resumed_at_ = 0;
    start_s_ = last_shown_s_ = wall_seconds();
  }
  void resume_at(uint64_t done) override {
    std::lock_guard lock(mutex_);
    done_ = resumed_at_ = done;
  }
  void advance(uint64_t count) override {
    done_ += count;
    std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock) return;  // another thread is showing the progress now
    const double now = wall_seconds();
    if (now - last_shown_s_ < line_.interval_s()) return;
    last_shown_s_ = now;
    show(now, false);
  }
  void set_total(uint64_t total) override {
    std::lock_guard lock(mutex_);
    total_ = total;
  }
  void end_stage() override {
    std::lock_guard lock(mutex_);
    show(wall_seconds(), true);
  }
  void warn(std::string_view message) override {
    std::lock_guard lock(mutex_);
    line_.warn(message);
  }

 private:
  void show(double now, bool ended) {
    const uint64_t done = done_;
    const double elapsed = std::max(now - start_s_, 1e-9);
    const auto done_here = static_cast<double>(done - resumed_at_);
    const auto missing = static_cast<double>(total_ - std::min(total_, resumed_at_));
    const double part = missing > 0 ? std::min(1.0, done_here / missing) : 0;
    const double left = part >= kMinPartForEstimate ? elapsed / part - elapsed : 0;
    const double rate = done_here / elapsed;
    line_.show({stage_, unit_, done, total_, elapsed, rate, left, {}}, ended);
  }

  ProgressLine line_;
  std::mutex mutex_;  // guards all members below except done_
  std::string stage_, unit_;
  uint64_t total_ = 0, resumed_at_ = 0;
  std::atomic<uint64_t> done_{0};
  double start_s_ = 0, last_shown_s_ = 0;
};

}  // namespace

ProgressLine::ProgressLine(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (open_) std::fputs("\n", stderr);
}

double ProgressLine::interval_s() const {
  return terminal_ ? kTerminalInterval_s : kPlainInterval_s;
}

void ProgressLine::show(const StageView& stage, bool ended) {
  if (quiet_) return;
  const auto done = static_cast<double>(stage.done);
  const auto total = static_cast<double>(stage.total);
  const double part = stage.total ? std::min(1.0, done / total) : 0;
  std::string line = terminal_ ? kClearLine : "";
  const size_t begin = line.size();
  line.append(printable_line(stage.name)).append(" ");
  line.resize(std::max(line.size(), begin + kNameWidth), ' ');
  if (terminal_ && stage.total && !ended) line += bar(part);
  if (stage.total && !ended) line += percent(part);
  line += short_count(done) + (stage.total ? " of " + short_count(total) : "");
  line += " " + printable_line(stage.unit) + ", " + short_count(stage.rate) + "/s, " +
          duration_text(stage.elapsed_s);
  if (!ended && !stage.overall.empty())
    line.append(", ").append(stage.overall);
  else if (!ended && stage.eta_s > 0)
    line += ", " + duration_text(stage.eta_s) + " left";
  open_ = terminal_ && !ended;
  if (!open_) line += "\n";
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

void ProgressLine::warn(std::string_view message) {
  note(std::string("voxdag: warning: ").append(message));
}

void ProgressLine::note(std::string_view text) {
  open_ = false;
  std::fprintf(stderr, "%s%s\n", terminal_ ? kClearLine : "", printable_line(text).c_str());
}

std::unique_ptr<Progress> make_progress_bar(bool quiet) {
  return std::make_unique<ProgressBar>(quiet);
}

}  // namespace voxdag::cli
