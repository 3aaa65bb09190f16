// The options and the status output for builds on a cluster, used by `build`, `plan` and `status`.
// In a program without cluster support (VOXDAG_CLUSTER=OFF), the option --cluster is refused, and
// the other cluster options do not exist.
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

// Adds the cluster options of `build` to `command`. Parsing stores their values in `state`.
void declare_cluster(Command& command, BuildClusterOptions& state);
// Sets the members of `run` that the cluster options determine.
void apply_cluster(const BuildClusterOptions& cluster, RunOptions& run);

// Adds the cluster options of `plan` to `command`. Parsing stores their values in `options`.
void declare_cluster(Command& command, ClusterOptions& options);

// Returns the state of a work folder's tasks as one JSON object, for `status`; "" if there are no
// tasks. If the state cannot be read, prints a warning on standard error.
std::string cluster_status_json(FileSystem& files, const std::string& work_folder);
void print_cluster_status(FileSystem& files, const std::string& work_folder);

}  // namespace voxdag::cli
