#include "scheduler/journal.h"

#include "core/base/clock.h"

namespace voxdag {
namespace {

// What a crash may cost beside the tasks in flight.
constexpr double kCommitInterval_s = 1;

}  // namespace

void Journal::built(const StoredSubvolume& subvolume) {
  if (pending_.empty() && last_commit_s_ == 0) last_commit_s_ = wall_seconds();
  pending_.push_back(subvolume);
  if (wall_seconds() - last_commit_s_ >= kCommitInterval_s) commit();
}

void Journal::commit() {
  if (pending_.empty()) return;
  segment_.sync();
  store_.record_built(pending_);
  pending_.clear();
  last_commit_s_ = wall_seconds();
}

}  // namespace voxdag
