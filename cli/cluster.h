// The parts of `build`, `plan` and `status` that concern clusters. Without cluster support
// (VOXDAG_CLUSTER=OFF) --cluster is refused and the other options are absent.
#pragma once

#include <string>

#include "cli/command.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag::cli {

struct BuildClusterOptions {
  ClusterOptions options;
  bool has_merge_job = false;
  std::string merge_options;
};

// Adds the options of `build`.
void declare_cluster(Command& command, BuildClusterOptions& state);
// Applies them.
void apply_cluster(const BuildClusterOptions& cluster, RunOptions& run);

// Adds the options of `plan`.
void declare_cluster(Command& command, ClusterOptions& options);

// The state of a work folder's tasks, for `status`: one JSON object, "" if there are no tasks. A
// state that cannot be read is a warning on standard error.
std::string cluster_status_json(FileSystem& files, const std::string& work_folder);
void print_cluster_status(FileSystem& files, const std::string& work_folder);

}  // namespace voxdag::cli
