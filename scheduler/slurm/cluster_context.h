// State shared by the parts of a cluster build (slurm_builder.cc): the build, its cluster options,
// its folder and its connection to Slurm.
#pragma once

#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

struct ClusterContext {
  // A build without cluster options also has a context: it accepts the results of tasks that an
  // earlier run started, but submits no tasks.
  explicit ClusterContext(BuildJob& build_job);

  FileSystem& files() const { return job.context.files; }
  Progress& progress() const { return job.context.progress; }

  BuildJob& job;
  const ClusterOptions options;
  const ClusterFolder folder;
  Slurm slurm;
};

// Returns the command runner in the spec's cluster options, else system_commands(). Only tests set
// a command runner in the options.
CommandRunner& commands_of(const BuildSpec& spec);
// Returns `path` in the form that tasks on other machines need: absolute and normalized.
std::string absolute_path(const std::string& path);

}  // namespace voxdag
