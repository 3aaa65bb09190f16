#include "scheduler/execute/commit_queue.h"

#include <chrono>
#include <exception>
#include <utility>

#include "core/base/clock.h"
#include "core/base/error.h"

namespace voxdag {

void CommitQueue::built(const StoredSubvolume& subvolume, std::optional<BinId> kept) {
  next_.subvolumes.push_back(subvolume);
  if (kept) next_.releases.push_back(*kept);
  if (is_due()) commit_soon();
}

void CommitQueue::commit() {
  commit_soon();
  settle();
}

void CommitQueue::announce() {
  // What is kept on the disk is not given back before its subvolumes are durable.
  if (!next_.releases.empty()) commit();
  settle();
  segment_->complete();
  store_.mark_built_in_memory(next_.subvolumes);
}

bool CommitQueue::is_due() const {
  if (segment_->size() - begun_bytes_ >= group_bytes_) return true;
  if (wall_seconds() - begun_s_ < interval_s_) return false;
  return !commit_.valid() ||
         commit_.wait_for(std::chrono::seconds(0)) != std::future_status::timeout;
}

void CommitQueue::commit_soon() {
  settle();
  if (next_.subvolumes.empty()) return;
  begun_s_ = wall_seconds();
  begun_bytes_ = segment_->size();
  under_way_ = std::exchange(next_, {});
  try {
    segment_->flush();
    // Where the system has no thread left, settle() does it.
    commit_ = std::async([this] { record_under_way(); });
  } catch (...) {
    salvage();
    throw;
  }
}

void CommitQueue::record_under_way() {
  segment_->sync_written();
  store_.record_built(under_way_.subvolumes);
  for (const BinId bin : under_way_.releases) bins_.release(bin);
}

void CommitQueue::settle() {
  if (!commit_.valid()) return;
  try {
    commit_.get();
  } catch (...) {
    salvage();
    throw;
  }
  under_way_ = {};
}

void CommitQueue::salvage() {
  Group group = std::exchange(under_way_, {});
  const Group later = std::exchange(next_, {});
  group.subvolumes.insert(group.subvolumes.end(), later.subvolumes.begin(), later.subvolumes.end());
  try {
    segment_->release_unwritten();
    segment_->sync_written();
    std::erase_if(group.subvolumes, [&](const StoredSubvolume& s) {
      return s.artifact.offset + s.artifact.bytes > segment_->written();
    });
  } catch (const std::exception&) {
    return;  // Then they are built again.
  }
  try {
    store_.record_built(group.subvolumes);
  } catch (const std::exception&) {
    // Durable, and recorded once the job store has room.
    next_.subvolumes = std::move(group.subvolumes);
  }
}

void CommitQueues::commit_soon() {
  for (const auto& journal : journals_) journal->commit_soon();
}

void CommitQueues::commit() {
  std::exception_ptr failure;
  for (const auto step : {&CommitQueue::commit_soon, &CommitQueue::commit}) {
    for (const auto& journal : journals_) {
      try {
        ((*journal).*step)();
      } catch (...) {
        if (!failure) failure = std::current_exception();
      }
    }
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace voxdag
