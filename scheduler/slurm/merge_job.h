// A cluster build whose merge is a job of the cluster as well (`--cluster-merge`): the submitting
// process submits the tasks, and a job that depends on them, unlocks the work folder and follows.
// The job is the same command: it takes the work folder over as any later run would, submits again
// what failed, waits for that and merges. So whoever follows may go away and come back, and if the
// job itself is lost the same command submits it again.
//
// What is known of the job is its name, which follows from the state of the build, and, once it is
// done, the report next to the output, which says what it was asked for.
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

  // The geometry options and the scene's files, those of its images too if there are to be colors,
  // with their sizes and times, as a digest; of the time when this was made.
  const std::string& request() const { return request_; }
  // The report of a merge job that did the same, if its output is there.
  std::optional<BuildReport> finished() const;
  // Whether a job that was stopped while it cleaned up, or is cleaning up, has left its work
  // folder.
  bool has_left_work() const;
  // Forgets what an earlier one has done.
  void forget_finished();
  // Whether such a job of the work folder's build waits or runs. Asks until Slurm answers.
  bool is_alive();
  // Shows how far the job `id`, "" if unknown, is, until it is done, and returns its report. Throws
  // Error with the job's own code if it fails, Error{kCanceled} if `context` is canceled: the job
  // runs on.
  BuildReport follow(const std::string& id);

 private:
  std::optional<std::vector<SlurmJob>> ask();
  void take_names(const ClusterState& state);
  void take_state(const SlurmJob& job);
  void cancel_given_up(const SlurmJob& job);
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
  std::set<std::string> noted_reasons_;  // why the job waits
  // As last known: the state is removed when the job is done.
  std::string name_, task_name_;
};

}  // namespace voxdag
