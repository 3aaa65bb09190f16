// State shared by the parts of a cluster build (cluster_builder.h): the build, its cluster options,
// its folder and its connection to Slurm.
#pragma once

#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

struct ClusterContext {
  // A build without cluster options can accept the results of earlier tasks, but submits none.
  explicit ClusterContext(BuildJob& build_job);

  FileSystem& files() const { return job.context.files; }
  Progress& progress() const { return job.context.progress; }

  BuildJob& job;
  const ClusterOptions options;
  const ClusterFolder folder;
  Slurm slurm;
};

// The command runner of a build: the test's, or the system's.
CommandRunner& commands_of(const BuildSpec& spec);
// `path` as tasks on other machines need it: absolute and normalized.
std::string absolute_path(const std::string& path);

}  // namespace voxdag
