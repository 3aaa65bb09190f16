// The strategy that decides where subvolumes are built: on threads of this process (ThreadBuilder)
// or in tasks of a cluster (ClusterBuilder). Other stages do not depend on it.
#pragma once

#include <span>
#include <string>

#include "scheduler/spec/build_report.h"
#include "scheduler/stages/ingest/ingest_stage.h"
#include "scheduler/state/job_store.h"

namespace voxdag {

class SubvolumeBuilder {
 public:
  virtual ~SubvolumeBuilder() = default;

  // Records subvolumes that an earlier run built outside this process for the scene with this
  // digest. Called after the plan is in the job store and before build().
  virtual void resume(const std::string& scene_digest) = 0;
  // Runs the partition and build stages: fills bins from the scene's triangles, builds `planned`,
  // and frees the triangles.
  virtual void build(PreparedScene& scene, std::span<const StoredSubvolume> planned) = 0;
  // Adds the builder's totals. Also called if there was nothing to build.
  virtual void add_to(BuildReport& report) const = 0;
};

}  // namespace voxdag
