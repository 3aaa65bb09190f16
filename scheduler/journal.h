// Records what one worker finished: artifacts are made durable in groups, about once a second, and
// only then named in the job store. Used by one thread.
#pragma once

#include <optional>
#include <vector>

#include "core/format/artifact.h"
#include "scheduler/job_store.h"
#include "scheduler/triangle_bins.h"

namespace voxdag {

class Journal {
 public:
  Journal(JobStore& store, SegmentWriter& segment, TriangleBins& bins)
      : store_(store), segment_(segment), bins_(bins) {}

  // The subvolume is built; its artifact, if it has one, is in the worker's segment. Once that is
  // recorded, the kept bin that its triangles came from, if any, is released.
  void built(const StoredSubvolume& subvolume, std::optional<BinId> kept);
  // Makes durable all that was built so far.
  void commit();

 private:
  // The disk is full: what it did take is made durable and recorded.
  void salvage();

  JobStore& store_;
  SegmentWriter& segment_;
  TriangleBins& bins_;
  std::vector<StoredSubvolume> pending_;
  std::vector<BinId> pending_releases_;
  double last_commit_s_ = 0;
};

}  // namespace voxdag
