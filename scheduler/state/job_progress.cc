#include "scheduler/state/job_progress.h"

#include <set>
#include <utility>

#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"

namespace voxdag {
namespace {

constexpr double kWriteIntervalS = 1;

}  // namespace

void refuse_warning(const Warning& warning) {
  throw Error(ErrorCode::kInvalidInput,
              warning.text() + "; " + option_text("strict") + " makes this an error");
}

template <class Change>
void JobProgress::update(Write write_when, const Change& change) {
  std::unique_lock lock(mutex_);
  change(snapshot_);
  const double now = wall_seconds();
  const bool is_due = now >= next_write_s_;
  if (!is_due && write_when == Write::kIfDue) return;
  if (is_due) next_write_s_ = now + kWriteIntervalS;
  lock.unlock();
  write(!is_due && write_when == Write::kUnlessEarly);
}

// Reads the snapshot while holding the lock of the store, so that an older snapshot never replaces
// a newer one.
void JobProgress::write(bool is_early) {
  std::lock_guard lock(store_mutex_);
  if (!store_ || (is_early && store_->is_in_memory())) return;
  ProgressSnapshot snapshot;
  {
    std::lock_guard snapshot_lock(mutex_);
    snapshot = snapshot_;
  }
  snapshot.updated_s = unix_seconds();
  snapshot.memory_bytes = resident_bytes();
  snapshot.disk_bytes = work_.bytes();
  shown_.set_usage(snapshot.memory_bytes, snapshot.disk_bytes);
  try {
    store_->set_progress(snapshot);
  } catch (const Error&) {
    // Nothing depends on this row. If the store cannot be written, the build itself will fail.
  }
}

void JobProgress::begin_stage(std::string_view stage, uint64_t total, std::string_view unit) {
  shown_.begin_stage(stage, total, unit);
  update(Write::kUnlessEarly, [&](ProgressSnapshot& s) {
    s.stage = stage;
    s.unit = unit;
    s.done = s.resumed_at = 0;
    s.total = total;
    s.stage_started_s = unix_seconds();
  });
}

void JobProgress::resume_at(uint64_t done) {
  shown_.resume_at(done);
  update(Write::kUnlessEarly, [&](ProgressSnapshot& s) { s.done = s.resumed_at = done; });
}

void JobProgress::advance(uint64_t count) {
  shown_.advance(count);
  update(Write::kIfDue, [&](ProgressSnapshot& s) { s.done += count; });
}

void JobProgress::set_total(uint64_t total) {
  shown_.set_total(total);
  std::lock_guard lock(mutex_);
  snapshot_.total = total;
}

void JobProgress::end_stage() {
  shown_.end_stage();
  update(Write::kUnlessEarly, [](ProgressSnapshot&) {});
}

void JobProgress::warn_of_input(const Warning& warning) {
  if (is_strict_) refuse_warning(warning);
  shown_.warn_of_input(warning);
  std::lock_guard lock(store_mutex_);
  if (store_) store_->add_warning(warning);
}

void JobProgress::record_failure(const Error& error) {
  update(Write::kNow, [&](ProgressSnapshot& s) {
    s.last_error = std::string(error_name(error.code())) + ": " + error.message();
  });
}

void JobProgress::detach() {
  std::lock_guard lock(store_mutex_);
  store_ = nullptr;
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
  std::set<std::pair<uint32_t, uint64_t>> artifacts;
  for (const StoredSubvolume& subvolume : all) {
    statuses.push_back(status_of(subvolume, grid_levels));
    // The subvolumes of a cluster batch share one artifact, which is counted once.
    if (!artifacts.emplace(subvolume.artifact.segment, subvolume.artifact.offset).second)
      statuses.back().bytes = 0;
  }
  progress.set_subvolumes(uint64_t{1} << grid_levels, statuses);
}

}  // namespace voxdag
