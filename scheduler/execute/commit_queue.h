// A worker's segment, and the record of what is in it: artifacts are made durable in groups, and
// only then named in the job store. That happens on a thread of its own, so that the disk keeps no
// worker waiting; and what was built since the last group is made durable only if the build goes on
// long enough to be worth it. Used by one thread at a time.
#pragma once

#include <future>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/clock.h"
#include "core/format/artifact/segment_writer.h"
#include "scheduler/job/job_store.h"
#include "scheduler/triangles/triangle_bins.h"

namespace voxdag {

class CommitQueue {
 public:
  static constexpr uint64_t kGroupBytes = uint64_t{256} << 20;

  // A group is begun after so many seconds, unless the last one is still under way, or so many
  // bytes. The first is what a crash may cost beside the tasks in flight and the group under way.
  CommitQueue(JobStore& store, std::unique_ptr<SegmentWriter> segment, TriangleBins& bins,
              double interval_s, uint64_t group_bytes = kGroupBytes)
      : store_(store),
        segment_(std::move(segment)),
        bins_(bins),
        interval_s_(interval_s),
        group_bytes_(group_bytes) {}

  SegmentWriter& segment() { return *segment_; }

  // The subvolume is built; its artifact, if it has one, is in the worker's segment. Once that is
  // recorded, the kept bin that its triangles came from, if any, is released. What went wrong with
  // an earlier group is thrown here. Waits for a disk that is a group of so many bytes behind.
  void built(const StoredSubvolume& subvolume, std::optional<BinId> kept);
  // Begins to make durable all that was built so far.
  void commit_soon();
  // Returns once it is. What fails is thrown once; what the disk took is tried again by the next
  // call.
  void commit();
  // Nothing more is built: the segment is complete, and what was built since the last group is
  // announced to the job store, durable only after commit(). The bins are not used any more.
  void announce();

 private:
  struct Group {
    std::vector<StoredSubvolume> subvolumes;
    std::vector<BinId> releases;
  };

  bool is_due() const;
  void record_under_way();
  // Waits for the group under way.
  void settle();
  // A group failed: what the disk did take is made durable and recorded.
  void salvage();

  JobStore& store_;
  const std::unique_ptr<SegmentWriter> segment_;
  TriangleBins& bins_;
  const double interval_s_;
  const uint64_t group_bytes_;
  Group next_, under_way_;
  double begun_s_ = wall_seconds();  // when this group began to fill
  uint64_t begun_bytes_ = 0;         // of the segment, then
  std::future<void> commit_;
};

// Journals of workers that are done, whose last groups may not be durable yet.
class CommitQueues {
 public:
  void add(std::unique_ptr<CommitQueue> journal) { journals_.push_back(std::move(journal)); }
  void commit_soon();
  // All of them, whichever fails; throws what failed first.
  void commit();
  // They are of no use any more.
  void drop() { journals_.clear(); }

 private:
  std::vector<std::unique_ptr<CommitQueue>> journals_;
};

}  // namespace voxdag
