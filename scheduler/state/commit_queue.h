// A worker's segment. Artifacts become durable in groups and are then recorded in the job store, on
// a separate thread, so that the worker does not wait for the disk. The last group becomes durable
// only by commit(): a short build ends before its artifacts are worth a sync. Not thread-safe.
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

  // A group is committed after `interval_s`, unless the one before is still being committed, or
  // once it has `group_bytes`. A crash costs the tasks in flight, the group being filled and the
  // group being committed.
  CommitQueue(JobStore& jobs, std::unique_ptr<SegmentWriter> segment, TriangleStore& triangles,
              double interval_s, uint64_t group_bytes = kGroupBytes)
      : jobs_(jobs),
        segment_(std::move(segment)),
        triangles_(triangles),
        interval_s_(interval_s),
        group_bytes_(group_bytes) {}

  SegmentWriter& segment() { return *segment_; }

  // The subvolume is built from the triangles in `bin`; its artifact, if it has one, is in the
  // segment. Drops the bin now, and releases it once the subvolume is recorded. Waits for a disk
  // that is a whole group behind. Throws the error of an earlier group.
  void add_built(const StoredSubvolume& subvolume, BinId bin);
  // Starts to make all built artifacts durable.
  void commit_in_background();
  // Makes all built artifacts durable. Throws an error once; the next call tries the remaining
  // artifacts again.
  void commit();
  // Nothing more is built: completes the segment and shows the last group in the job store, durable
  // only after commit(). The triangle store is not used any more.
  void finish();

 private:
  struct Group {
    std::vector<StoredSubvolume> subvolumes;
    std::vector<BinId> bins;  // to be released
  };

  bool is_due() const;
  // Makes pending_group_ durable.
  void commit_pending();
  // Waits for commit_pending() on the other thread, and throws what went wrong there.
  void wait();
  // Called after a failure: makes the artifacts of both groups durable and records them, as far as
  // the disk accepts them.
  void recover();

  JobStore& jobs_;
  const std::unique_ptr<SegmentWriter> segment_;
  TriangleStore& triangles_;
  const double interval_s_;
  const uint64_t group_bytes_;
  Group next_group_, pending_group_;
  double group_begun_s_ = wall_seconds();  // when next_group_ began to fill
  uint64_t group_offset_ = 0;              // the segment's size then
  std::future<void> pending_;
};

// The queues of workers that are done, whose last groups may not be durable yet.
class CommitQueues {
 public:
  void add(std::unique_ptr<CommitQueue> queue) { queues_.push_back(std::move(queue)); }
  void commit_in_background();
  // Commits all of them, even if some fail; throws the first error.
  void commit();
  // Closes the segments: nothing is committed any more.
  void clear() { queues_.clear(); }

 private:
  std::vector<std::unique_ptr<CommitQueue>> queues_;
};

}  // namespace voxdag
