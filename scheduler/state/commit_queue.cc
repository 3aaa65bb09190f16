#include "scheduler/state/commit_queue.h"

#include <chrono>
#include <exception>
#include <utility>

#include "core/base/background.h"
#include "core/base/clock.h"
#include "core/base/error.h"

namespace voxdag {

void CommitQueue::add_built(const StoredSubvolume& subvolume, BinId bin) {
  next_group_.subvolumes.push_back(subvolume);
  if (triangles_.drop(bin)) next_group_.bins.push_back(bin);
  if (is_due()) commit_in_background();
}

void CommitQueue::commit() {
  commit_in_background();
  wait();
}

void CommitQueue::finish() {
  // If bins must be released, commits now: bins are released only after a commit, and finish() is
  // the last use of the triangle store.
  if (!next_group_.bins.empty()) commit();
  wait();
  segment_->complete();
  jobs_.mark_built_in_memory(next_group_.subvolumes);
}

bool CommitQueue::is_due() const {
  if (segment_->size() - group_offset_ >= group_bytes_) return true;
  if (wall_seconds() - group_begun_s_ < interval_s_) return false;
  return !pending_.valid() ||
         pending_.wait_for(std::chrono::seconds(0)) != std::future_status::timeout;
}

void CommitQueue::commit_in_background() {
  wait();
  if (next_group_.subvolumes.empty()) return;
  group_begun_s_ = wall_seconds();
  group_offset_ = segment_->size();
  pending_group_ = std::exchange(next_group_, {});
  try {
    segment_->flush();
    pending_ = run_in_background([this] { commit_pending(); });
  } catch (...) {
    recover();
    throw;
  }
}

void CommitQueue::commit_pending() {
  segment_->sync_written();
  jobs_.record_built(pending_group_.subvolumes);
  for (const BinId bin : pending_group_.bins) triangles_.release(bin);
}

void CommitQueue::wait() {
  if (!pending_.valid()) return;
  try {
    pending_.get();
  } catch (...) {
    recover();
    throw;
  }
  pending_group_ = {};
}

void CommitQueue::recover() {
  Group group = std::exchange(pending_group_, {});
  const Group later = std::exchange(next_group_, {});
  group.subvolumes.insert(group.subvolumes.end(), later.subvolumes.begin(), later.subvolumes.end());
  try {
    segment_->release_unwritten();
    segment_->sync_written();
    std::erase_if(group.subvolumes, [&](const StoredSubvolume& s) {
      return s.artifact.offset + s.artifact.bytes > segment_->written();
    });
  } catch (const std::exception&) {
    return;  // The subvolumes are built again.
  }
  try {
    jobs_.record_built(group.subvolumes);
  } catch (const std::exception&) {
    // The artifacts are durable; the next commit records them.
    next_group_.subvolumes = std::move(group.subvolumes);
  }
}

void CommitQueues::commit_in_background() {
  for (const auto& queue : queues_) queue->commit_in_background();
}

void CommitQueues::commit() {
  std::exception_ptr failure;
  for (const auto step : {&CommitQueue::commit_in_background, &CommitQueue::commit}) {
    for (const auto& queue : queues_) {
      try {
        ((*queue).*step)();
      } catch (...) {
        if (!failure) failure = std::current_exception();
      }
    }
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace voxdag
