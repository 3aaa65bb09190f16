// Forwards progress and warnings to the functions of BuildHooks. Thread-safe.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include "core/base/progress.h"
#include "voxdag/build.h"

namespace voxdag {

class HookProgress : public Progress {
 public:
  // `hooks` must outlive this object.
  explicit HookProgress(const BuildHooks& hooks) : hooks_(hooks) {}

  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override;
  void resume_at(uint64_t done) override;
  void advance(uint64_t count) override;
  void set_total(uint64_t total) override;
  void end_stage() override;
  void warn(std::string_view message) override;

 private:
  using Clock = std::chrono::steady_clock;

  void report_if_due();

  const BuildHooks& hooks_;
  std::mutex mutex_;  // guards all members below, and the calls of hooks
  std::string stage_, unit_;
  uint64_t done_ = 0, total_ = 0;
  Clock::time_point next_report_{};
};

}  // namespace voxdag
