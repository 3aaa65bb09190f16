#include "cli/terminal/progress_bar.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <string>

#include "cli/terminal/progress_line.h"
#include "core/base/clock.h"

namespace voxdag::cli {
namespace {

constexpr double kMinPartForEstimate = 0.01;  // too little is done for an estimate of the time left

class ProgressBar : public Progress {
 public:
  explicit ProgressBar(bool quiet) : line_(quiet) {}

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
    if (!lock) return;  // another thread is just showing it
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
    const double part =
        total_ ? std::min(1.0, static_cast<double>(done) / static_cast<double>(total_)) : 0;
    const double left = part >= kMinPartForEstimate ? elapsed / part - elapsed : 0;
    const double rate = static_cast<double>(done) / elapsed;
    line_.show({stage_, unit_, done, total_, elapsed, rate, left}, ended);
  }

  ProgressLine line_;
  std::mutex mutex_;  // guards all below but done_
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
