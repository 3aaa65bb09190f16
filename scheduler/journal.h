// Records what one worker finished: artifacts are made durable in groups, about once a second, and
// only then named in the job store. Used by one thread.
#pragma once

#include <vector>

#include "core/format/artifact.h"
#include "scheduler/job_store.h"

namespace voxdag {

class Journal {
 public:
  Journal(JobStore& store, SegmentWriter& segment) : store_(store), segment_(segment) {}

  // The subvolume is built; its artifact, if it has one, is in the worker's segment.
  void built(const StoredSubvolume& subvolume);
  // Makes durable all that was built so far.
  void commit();

 private:
  // The disk is full: what it did take is made durable and recorded.
  void salvage();

  JobStore& store_;
  SegmentWriter& segment_;
  std::vector<StoredSubvolume> pending_;
  double last_commit_s_ = 0;
};

}  // namespace voxdag
