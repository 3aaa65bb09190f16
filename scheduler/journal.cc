#include "scheduler/journal.h"

#include <chrono>
#include <utility>

#include "core/base/clock.h"
#include "core/base/error.h"

namespace voxdag {
namespace {

// What a crash may cost beside the tasks in flight and the group on its way to the disk; and what
// may be left to write when all is built, which nothing is built beside.
constexpr double kGroupInterval_s = 1;
// Groups that one may grow to while the disk does not keep up.
constexpr uint64_t kMostGroupsBehind = 4;

}  // namespace

void Journal::built(const StoredSubvolume& subvolume, std::optional<BinId> kept) {
  if (next_.subvolumes.empty() && begun_s_ == 0) begun_s_ = wall_seconds();
  next_.subvolumes.push_back(subvolume);
  if (kept) next_.releases.push_back(*kept);
  if (is_due()) begin_commit();
}

void Journal::commit() {
  begin_commit();
  settle();
}

bool Journal::is_due() const {
  const uint64_t bytes = segment_.size() - begun_bytes_;
  if (bytes >= kMostGroupsBehind * group_bytes_) return true;
  if (wall_seconds() - begun_s_ < kGroupInterval_s && bytes < group_bytes_) return false;
  return !commit_.valid() ||
         commit_.wait_for(std::chrono::seconds(0)) != std::future_status::timeout;
}

void Journal::begin_commit() {
  settle();
  if (next_.subvolumes.empty()) return;
  begun_s_ = wall_seconds();
  begun_bytes_ = segment_.size();
  under_way_ = std::exchange(next_, {});
  try {
    segment_.flush();
    // Where the system has no thread left, settle() does it.
    commit_ = std::async([this] { record_under_way(); });
  } catch (...) {
    salvage();
    throw;
  }
}

void Journal::record_under_way() {
  segment_.sync_written();
  store_.record_built(under_way_.subvolumes);
  for (const BinId bin : under_way_.releases) bins_.release(bin);
}

void Journal::settle() {
  if (!commit_.valid()) return;
  try {
    commit_.get();
  } catch (...) {
    salvage();
    throw;
  }
  under_way_ = {};
}

void Journal::salvage() {
  Group group = std::exchange(under_way_, {});
  const Group later = std::exchange(next_, {});
  group.subvolumes.insert(group.subvolumes.end(), later.subvolumes.begin(), later.subvolumes.end());
  try {
    segment_.release_unwritten();
    segment_.sync_written();
    std::erase_if(group.subvolumes, [&](const StoredSubvolume& s) {
      return s.artifact.offset + s.artifact.bytes > segment_.written();
    });
    store_.record_built(group.subvolumes);
  } catch (const std::exception&) {
    // Then they are built again.
  }
}

}  // namespace voxdag
