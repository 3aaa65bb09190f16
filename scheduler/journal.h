// Records what one worker finished: artifacts are made durable in groups, and only then named in
// the job store. That happens on a thread of its own, so that the disk keeps no worker waiting.
// Used by one thread.
#pragma once

#include <future>
#include <optional>
#include <vector>

#include "core/format/artifact.h"
#include "scheduler/job_store.h"
#include "scheduler/triangle_bins.h"

namespace voxdag {

class Journal {
 public:
  // A group is begun about once a second or after so many bytes.
  static constexpr uint64_t kGroupBytes = uint64_t{16} << 20;

  Journal(JobStore& store, SegmentWriter& segment, TriangleBins& bins,
          uint64_t group_bytes = kGroupBytes)
      : store_(store), segment_(segment), bins_(bins), group_bytes_(group_bytes) {}

  // The subvolume is built; its artifact, if it has one, is in the worker's segment. Once that is
  // recorded, the kept bin that its triangles came from, if any, is released. What went wrong with
  // an earlier group is thrown here. Waits for the disk where four groups would wait for it.
  void built(const StoredSubvolume& subvolume, std::optional<BinId> kept);
  // Makes durable all that was built so far.
  void commit();

 private:
  struct Group {
    std::vector<StoredSubvolume> subvolumes;
    std::vector<BinId> releases;
  };

  bool is_due() const;
  void begin_commit();
  void record_under_way();
  // Waits for the group under way.
  void settle();
  // The disk is full: what it did take is made durable and recorded.
  void salvage();

  JobStore& store_;
  SegmentWriter& segment_;
  TriangleBins& bins_;
  const uint64_t group_bytes_;
  Group next_, under_way_;
  double begun_s_ = 0;        // when the last group began to be recorded, or this one to fill
  uint64_t begun_bytes_ = 0;  // of the segment, then
  std::future<void> commit_;
};

}  // namespace voxdag
