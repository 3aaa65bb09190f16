#include <cstdio>

#include "cli/command.h"
#include "core/base/error.h"
#include "core/base/text/printable.h"
#include "scheduler/cluster/cluster.h"
#include "scheduler/slurm/files/cluster_state.h"

namespace voxdag::cli {
namespace {

struct StopTasksCommand {
  std::string work_folder;
};

void run(const StopTasksCommand& command, CommandContext& context) {
  const auto state = read_cluster_state(context.files, command.work_folder);
  if (!state)
    throw Error(ErrorCode::kNotFound,
                command.work_folder +
                    " has no record of cluster tasks: expected the work folder "
                    "of a build on a cluster");
  stop_cluster_tasks(context.files, command.work_folder);
  std::printf("stopped the tasks %s; finished subvolumes are kept\n",
              printable_line(state->task_name()).c_str());
}

void declare(Command& command, StopTasksCommand& state) {
  command.option("work", state.work_folder, "the work folder of the build").required();
}

}  // namespace

void add_stop_tasks_command(CommandLine& line) {
  add_command<StopTasksCommand>(line, "stop-tasks", "stop the cluster tasks of a build");
}

}  // namespace voxdag::cli
