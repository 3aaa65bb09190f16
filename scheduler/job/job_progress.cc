#include "scheduler/job/job_progress.h"

#include "core/base/clock.h"
#include "core/base/process_limits.h"

namespace voxdag {
namespace {

constexpr double kRecordInterval_s = 1;

double unix_seconds() { return clock_seconds(CLOCK_REALTIME); }

}  // namespace

void JobProgress::begin_stage(std::string_view stage, uint64_t total, std::string_view unit) {
  shown_.begin_stage(stage, total, unit);
  std::lock_guard lock(mutex_);
  snapshot_.stage = stage;
  snapshot_.unit = unit;
  snapshot_.done = 0;
  snapshot_.total = total;
  snapshot_.stage_started_s = unix_seconds();
  record(true);
}

void JobProgress::advance(uint64_t count) {
  shown_.advance(count);
  std::lock_guard lock(mutex_);
  snapshot_.done += count;
  record(false);
}

void JobProgress::set_total(uint64_t total) {
  shown_.set_total(total);
  std::lock_guard lock(mutex_);
  snapshot_.total = total;
}

void JobProgress::end_stage() {
  shown_.end_stage();
  std::lock_guard lock(mutex_);
  record(true);
}

void JobProgress::record_failure(const Error& error) {
  std::lock_guard lock(mutex_);
  snapshot_.last_error = std::string(error_name(error.code())) + ": " + error.message();
  record(true);
}

void JobProgress::detach() {
  std::lock_guard lock(mutex_);
  store_ = nullptr;
}

void JobProgress::record(bool at_once) {
  const double now = wall_seconds();
  if (!store_ || (!at_once && now - last_recorded_s_ < kRecordInterval_s)) return;
  last_recorded_s_ = now;
  snapshot_.updated_s = unix_seconds();
  snapshot_.memory_bytes = resident_bytes();
  snapshot_.disk_bytes = work_.bytes();
  try {
    store_->set_progress(snapshot_);
  } catch (const Error&) {
    // Looking on is a comfort; a store that cannot be written will say so when it matters.
  }
}

}  // namespace voxdag
