// Builds subvolumes in tasks of a cluster. The submitting process cuts the planned subvolumes into
// batches (BatchTable), submits a task for each (TaskPoller) and records the tasks' results in the
// job store (RecordCollector). The merge then runs as in any build.
//
// Builds without a cluster use accept_earlier_tasks() and remove_tasks(), because an earlier run of
// the same job may have started tasks.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "scheduler/slurm/batch_table.h"
#include "scheduler/slurm/cluster_context.h"
#include "scheduler/slurm/record_collector.h"
#include "scheduler/slurm/task_poller.h"
#include "scheduler/stages/build/subvolume_builder.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

class ClusterBuilder : public SubvolumeBuilder {
 public:
  explicit ClusterBuilder(BuildJob& job) : job_(job), cluster_(job) {}

  // Resume rule: open batches of an earlier run remain open, and records that its tasks have
  // written since then are accepted.
  void resume(const std::string& scene_digest) override;
  // Cuts the triangles of `planned` into batches. Then waits until all batches are built, unless a
  // merge job waits instead. Throws Error with the last reason if a batch has failed too often;
  // other tasks continue to run.
  void build(PreparedScene& scene, std::span<const StoredSubvolume> planned) override;
  void add_to(BuildReport& report) const override;
  // Submits all batches that Slurm accepts now, and a merge job that starts when their tasks have
  // ended. Returns the merge job's id. The merge job resubmits failed batches.
  std::string submit_merge_job();

 private:
  void add_batches(PreparedScene& scene, std::span<const StoredSubvolume> planned);
  void wait_for_batches();

  BuildJob& job_;
  ClusterContext cluster_;
  BatchTable batches_{cluster_};
  RecordCollector records_{cluster_, batches_};
  TaskPoller tasks_{cluster_, batches_};
};

// Throws Error{kInvalidInput} if Slurm is not installed, or if it would refuse the tasks of a build
// with cluster options.
void check_cluster(const BuildSpec& spec, const BuildContext& context);
// Records the results of tasks that an earlier run started for the scene with this digest.
void accept_earlier_tasks(BuildJob& job, const std::string& scene_digest);
// Stops running tasks of the work folder and removes their files. If a task cannot be stopped, this
// is only a warning: the task will fail because its batch file is missing.
void remove_tasks(BuildJob& job);
// True if this process is the merge job.
bool is_merge_job(const BuildSpec& spec);

}  // namespace voxdag
