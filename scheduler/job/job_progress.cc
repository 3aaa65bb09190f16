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
  shown_.set_usage(snapshot_.memory_bytes, snapshot_.disk_bytes);
  try {
    store_->set_progress(snapshot_);
  } catch (const Error&) {
    // Looking on is a comfort; a store that cannot be written will say so when it matters.
  }
}

SubvolumeStatus status_of(const StoredSubvolume& subvolume, uint32_t grid_levels) {
  SubvolumeStatus status;
  status.id = subvolume.id;
  status.edge = static_cast<uint64_t>(subvolume.cube.edge_voxels(grid_levels));
  for (int a = 0; a < 3; ++a) status.corner[a] = subvolume.cube.position[a] * status.edge;
  status.built = subvolume.state == SubvolumeState::kBuilt;
  status.voxels = subvolume.summary.voxels;
  status.nodes = subvolume.summary.dag_nodes;
  status.bytes = subvolume.artifact.bytes;
  return status;
}

void report_subvolumes(std::span<const StoredSubvolume> all, uint32_t grid_levels,
                       Progress& progress) {
  std::vector<SubvolumeStatus> statuses;
  statuses.reserve(all.size());
  for (const StoredSubvolume& subvolume : all)
    statuses.push_back(status_of(subvolume, grid_levels));
  progress.set_subvolumes(uint64_t{1} << grid_levels, statuses);
}

}  // namespace voxdag
