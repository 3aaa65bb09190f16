// State shared by the parts of a cluster build (slurm_builder.cc): the build, its cluster options,
// its folder and its connection to Slurm.
#pragma once

#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

struct ClusterContext {
  // Works without cluster options. Such a build can accept the results of earlier tasks, but
  // submits none.
  explicit ClusterContext(BuildJob& build_job);

  FileSystem& files() const { return job.context.files; }
  Progress& progress() const { return job.context.progress; }

  BuildJob& job;
  const ClusterOptions options;
  const ClusterFolder folder;
  Slurm slurm;
};

// Returns the build's command runner: the one from its options (tests), else the system's.
CommandRunner& commands_of(const BuildSpec& spec);
// Returns `path` in the form that tasks on other machines need: absolute and normalized.
std::string absolute_path(const std::string& path);

}  // namespace voxdag
