// A cluster build whose merge is also a job of the cluster (`--cluster-merge`). The submitting
// process submits the tasks and a job that depends on them, unlocks the work folder and follows the
// job. The job is the same command: it resumes the work folder as any later run does, resubmits
// failed batches, waits for them and merges. The following process may be stopped and started
// again. If the job is lost, the same command submits it again. While the job exists, it is found
// by its name, which depends only on the state of the build. When it has ended, it is found by the
// report next to the output, which contains the job's request.
#pragma once

#include <optional>
#include <set>
#include <string>

#include "scene/triangle_source.h"
#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/slurm/files/cluster_state.h"
#include "scheduler/spec/build_report.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

class MergeJob {
 public:
  // `spec` and `context` must outlive this.
  MergeJob(const BuildSpec& spec, const TriangleSource& scene, const std::string& work_folder,
           const BuildContext& context, CommandRunner& commands);

  // Digest of the geometry options and of the scene's files with their sizes and times, taken by
  // the constructor. Image files are included if the build has attributes.
  const std::string& request() const { return request_; }
  // Returns the report of a finished merge job with the same request whose output exists.
  std::optional<BuildReport> finished() const;
  // True if the work folder still exists: the job is still removing it, or was stopped earlier.
  bool has_remaining_work() const;
  // Removes the report of an earlier merge job.
  void forget_finished();
  // True if the work folder's merge job is waiting or running. Repeats the query until Slurm
  // answers.
  bool is_alive();
  // Shows the progress of job `id` ("" if unknown) until it has ended, and returns its report.
  // Throws Error with the job's error code if it fails. Throws Error{kCanceled} if `context` is
  // canceled; the job continues to run.
  BuildReport follow(const std::string& id);

 private:
  std::optional<std::vector<SlurmJob>> query_jobs();
  void set_names(const ClusterState& state);
  void report_state(const SlurmJob& job);
  void cancel_held(const SlurmJob& job);
  void show_progress();
  [[noreturn]] void fail(const std::string& id, const std::optional<SlurmEnd>& end) const;

  const BuildSpec& spec_;
  const ClusterOptions& options_;
  const BuildContext& context_;
  const ClusterFolder folder_;
  Slurm slurm_;
  const std::string request_;
  bool is_answering_ = true;
  bool is_running_ = false;
  uint64_t shown_built_ = 0;
  std::set<std::string> warned_reasons_;  // why the job waits
  // Names from the last state that was read, because a finished job removes the state.
  std::string name_, task_name_;
};

}  // namespace voxdag
