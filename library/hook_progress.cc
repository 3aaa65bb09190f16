#include "library/hook_progress.h"

namespace voxdag {
namespace {

constexpr std::chrono::milliseconds kReportInterval{100};

}  // namespace

void HookProgress::begin_stage(std::string_view stage, uint64_t total, std::string_view unit) {
  const std::lock_guard lock(mutex_);
  stage_ = stage;
  unit_ = unit;
  done_ = 0;
  total_ = total;
  report_if_due();
}

void HookProgress::resume_at(uint64_t done) {
  const std::lock_guard lock(mutex_);
  done_ = done;
}

void HookProgress::advance(uint64_t count) {
  const std::lock_guard lock(mutex_);
  done_ += count;
  report_if_due();
}

void HookProgress::set_total(uint64_t total) {
  const std::lock_guard lock(mutex_);
  total_ = total;
}

void HookProgress::end_stage() {
  const std::lock_guard lock(mutex_);
  report_if_due();
}

void HookProgress::warn(std::string_view message) {
  const std::lock_guard lock(mutex_);
  if (hooks_.on_warning) hooks_.on_warning(message);
}

void HookProgress::report_if_due() {
  if (!hooks_.on_progress || Clock::now() < next_report_) return;
  hooks_.on_progress({stage_, unit_, done_, total_});
  next_report_ = Clock::now() + kReportInterval;
}

}  // namespace voxdag
