// Where the subvolumes of a build are built: by threads of this process (ThreadBuilder) or by tasks
// of a cluster (ClusterBuilder). The stages before and after do not ask which.
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

  // Records in the job store what an earlier run had built elsewhere, for the scene of that digest.
  // Called once the plan is in the job store, before build().
  virtual void resume(const std::string& scene_digest) = 0;
  // The partition and build stages: fills bins from the scene's triangles and builds `planned`.
  // Frees the triangles.
  virtual void build(PreparedScene& scene, std::span<const StoredSubvolume> planned) = 0;
  // Adds what only the builder knows, also if there was nothing to build.
  virtual void add_to(BuildReport& report) const = 0;
};

}  // namespace voxdag
