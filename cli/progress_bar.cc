#include "cli/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <string>

#include "cli/size.h"
#include "core/base/clock.h"

namespace voxdag::cli {
namespace {

constexpr double kLeastPartToForesee = 0.01;  // a time left reckoned from less is a guess
constexpr double kTerminalInterval_s = 0.1;
constexpr double kPlainInterval_s = 5;
constexpr int kBarWidth = 24;
constexpr size_t kNameWidth = 11;

// 1234567 -> "1.23 M"
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

class ProgressBar : public Progress {
 public:
  explicit ProgressBar(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override {
    std::lock_guard lock(mutex_);
    stage_ = stage;
    unit_ = unit;
    total_ = total;
    done_ = 0;
    start_s_ = last_shown_s_ = wall_seconds();
  }
  void advance(uint64_t count) override {
    done_ += count;
    std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock) return;  // somebody else is just showing it
    const double now = wall_seconds();
    if (now - last_shown_s_ < (terminal_ ? kTerminalInterval_s : kPlainInterval_s)) return;
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
    std::fprintf(stderr, "%svoxdag: warning: %.*s\n", terminal_ ? "\r\033[K" : "",
                 static_cast<int>(message.size()), message.data());
  }

 private:
  void show(double now, bool ended) {
    if (quiet_) return;
    const double elapsed = std::max(now - start_s_, 1e-9);
    const double done = static_cast<double>(done_.load());
    const double part = total_ ? std::min(1.0, done / static_cast<double>(total_)) : 0;
    std::string line = stage_ + ' ';
    line.resize(std::max<size_t>(line.size(), kNameWidth), ' ');
    if (terminal_) line = "\r\033[K" + line;
    if (terminal_ && total_ && !ended) line += bar(part);
    if (total_ && !ended) line += percent(part);
    line += short_count(done) + (total_ ? " of " + short_count(static_cast<double>(total_)) : "");
    line += " " + unit_ + ", " + short_count(done / elapsed) + "/s, " + duration_text(elapsed);
    if (!ended && part >= kLeastPartToForesee)
      line += ", " + duration_text(elapsed / part - elapsed) + " left";
    if (!terminal_ || ended) line += "\n";
    std::fputs(line.c_str(), stderr);
    std::fflush(stderr);
  }
  static std::string bar(double part) {
    const auto full = static_cast<size_t>(std::floor(part * kBarWidth));
    return "[" + std::string(full, '#') + std::string(kBarWidth - full, '.') + "] ";
  }
  static std::string percent(double part) {
    char text[16];
    std::snprintf(text, sizeof text, "%3.0f %%  ", 100 * part);
    return text;
  }

  const bool quiet_;
  const bool terminal_;
  std::mutex mutex_;  // guards all but done_
  std::string stage_, unit_;
  uint64_t total_ = 0;
  std::atomic<uint64_t> done_{0};
  double start_s_ = 0, last_shown_s_ = 0;
};

}  // namespace

std::unique_ptr<Progress> make_progress_bar(bool quiet) {
  return std::make_unique<ProgressBar>(quiet);
}

}  // namespace voxdag::cli
