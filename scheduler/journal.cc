#include "scheduler/journal.h"

#include "core/base/clock.h"
#include "core/base/error.h"

namespace voxdag {
namespace {

// What a crash may cost beside the tasks in flight.
constexpr double kCommitInterval_s = 1;

}  // namespace

void Journal::built(const StoredSubvolume& subvolume, std::optional<BinId> kept) {
  if (pending_.empty() && last_commit_s_ == 0) last_commit_s_ = wall_seconds();
  pending_.push_back(subvolume);
  if (kept) pending_releases_.push_back(*kept);
  if (wall_seconds() - last_commit_s_ >= kCommitInterval_s) commit();
}

void Journal::commit() {
  if (pending_.empty()) return;
  try {
    segment_.sync();
  } catch (const Error&) {
    salvage();
    throw;
  }
  store_.record_built(pending_);
  pending_.clear();
  for (const BinId bin : pending_releases_) bins_.release(bin);
  pending_releases_.clear();
  last_commit_s_ = wall_seconds();
}

void Journal::salvage() {
  try {
    segment_.sync_written();
    std::erase_if(pending_, [&](const StoredSubvolume& s) {
      return s.artifact.offset + s.artifact.bytes > segment_.written();
    });
    store_.record_built(pending_);
  } catch (const Error&) {
    // Then they are built again.
  }
  pending_.clear();
}

}  // namespace voxdag
