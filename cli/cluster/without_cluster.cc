// The functions of cluster.h in a program without cluster support.
#include "cli/cluster.h"
#include "scheduler/cluster/cluster.h"

namespace voxdag::cli {
namespace {

void declare_refused(Command& command) {
  command
      .text_option(
          "--cluster", "NAME", [](const std::string&) { check_cluster_support(); }, "")
      .group("");
}

}  // namespace

void declare_cluster(Command& command, BuildClusterOptions&) { declare_refused(command); }

void declare_cluster(Command& command, ClusterOptions&) { declare_refused(command); }

void apply_cluster(const BuildClusterOptions&, RunOptions&) {}

std::string cluster_status_json(FileSystem&, const std::string&) { return ""; }

void print_cluster_status(FileSystem&, const std::string&) {}

}  // namespace voxdag::cli
