// Builds subvolumes by the tasks of a cluster, and what a build without a cluster does about tasks
// that an earlier run of the same job has started.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "scheduler/slurm/cluster_build.h"
#include "scheduler/stages/build/subvolume_builder.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

class ClusterBuilder : public SubvolumeBuilder {
 public:
  explicit ClusterBuilder(BuildJob& job) : job_(job) {}

  void resume(const std::string& scene_digest) override;
  // Cuts the triangles of `planned` into batches. Unless a job of the cluster merges, follows their
  // tasks until all are built.
  void build(PreparedScene& scene, std::span<const StoredSubvolume> planned) override;
  void add_to(BuildReport& report) const override;
  // ClusterBuild::submit_merge_job().
  std::string submit_merge_job() { return cluster_->submit_merge_job(); }

 private:
  BuildJob& job_;
  std::unique_ptr<ClusterBuild> cluster_;
};

// Records what tasks of an earlier run have built for the scene of that digest.
void accept_earlier_tasks(BuildJob& job, const std::string& scene_digest);
// Stops tasks that may still run for the work folder, and removes their files. A task that cannot
// be stopped is a warning: without its batch it fails.
void remove_tasks(BuildJob& job);

// Runs Slurm's commands for a build.
CommandRunner& commands_of(const BuildSpec& spec);
// True if this process is the job of the cluster that merges.
bool is_merge_job(const BuildSpec& spec);

}  // namespace voxdag
