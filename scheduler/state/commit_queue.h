// A worker's segment, and the built subvolumes that are not recorded yet. Artifacts become durable
// in groups and are then recorded in the job store, on a separate thread, so that the worker does
// not wait for the disk. The last group is different:
//   - With a MemoryStore of triangles, the group is merged before it is durable. Only commit()
//     makes it durable. A short build does not call commit(), which saves the wait for the disk.
//   - With a DurableStore, finish() makes the group durable, because the bins of its triangles must
//     not be released before that.
// Not thread-safe.
#pragma once

#include <future>
#include <memory>
#include <vector>

#include "core/base/clock.h"
#include "core/format/artifact/segment_writer.h"
#include "scheduler/state/job_store.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

class CommitQueue {
 public:
  static constexpr uint64_t kGroupBytes = uint64_t{256} << 20;

  // A group is committed when its artifacts take `group_bytes` bytes. It is also committed
  // `interval_s` seconds after it was begun, unless the previous group is still being committed. A
  // crash loses the subvolumes being built, the group being filled and the group being committed.
  CommitQueue(JobStore& jobs, std::unique_ptr<SegmentWriter> segment, TriangleStore& triangles,
              double interval_s, uint64_t group_bytes = kGroupBytes)
      : jobs_(jobs),
        segment_(std::move(segment)),
        triangles_(triangles),
        interval_s_(interval_s),
        group_bytes_(group_bytes) {}

  SegmentWriter& segment() { return *segment_; }

  // Adds a subvolume that was built from the triangles in `bin`; its artifact, if any, is in the
  // segment. Drops the bin now, and releases it after the subvolume is recorded. If the subvolume
  // completes a group while the previous group is still being committed, waits for the previous
  // group. Throws the error of an earlier group.
  void add_built(const StoredSubvolume& subvolume, BinId bin);
  // Starts making all built artifacts durable.
  void commit_in_background();
  // Makes all built artifacts durable. Throws each error once; the next call retries the remaining
  // artifacts.
  void commit();
  // Called when the worker has no more subvolumes. Completes the segment. If the last group has
  // bins of triangles to release, commits it now, because the triangle store is not used after this
  // call. Otherwise the group becomes durable only with a later commit(). Until then,
  // JobStore::leaves() in this process returns its subvolumes as built.
  void finish();

 private:
  struct Group {
    std::vector<StoredSubvolume> subvolumes;
    std::vector<BinId> bins;  // bins to release
  };

  bool is_due() const;
  // Makes pending_group_ durable.
  void commit_pending();
  // Waits for commit_pending() on the other thread and throws its error, if any.
  void wait();
  // Called after a failure. Makes the artifacts of pending_group_ and next_group_ durable and
  // records them, as far as the disk accepts them.
  void recover();

  JobStore& jobs_;
  const std::unique_ptr<SegmentWriter> segment_;
  TriangleStore& triangles_;
  const double interval_s_;
  const uint64_t group_bytes_;
  Group next_group_, pending_group_;
  double group_begun_s_ = wall_seconds();  // when next_group_ began to fill
  uint64_t group_offset_ = 0;              // the segment's size at that time
  std::future<void> pending_;
};

// The queues of finished workers. Their last groups are possibly not durable yet.
class CommitQueues {
 public:
  void add(std::unique_ptr<CommitQueue> queue) { queues_.push_back(std::move(queue)); }
  void commit_in_background();
  // Commits all queues, even if some fail. Throws the first error.
  void commit();
  // Closes the segments. Nothing can be committed afterwards.
  void clear() { queues_.clear(); }

 private:
  std::vector<std::unique_ptr<CommitQueue>> queues_;
};

}  // namespace voxdag
