#include "scheduler/slurm/stop_tasks.h"

#include "core/base/error.h"
#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/slurm/files/cluster_state.h"

namespace voxdag {

void stop_cluster_tasks(FileSystem& files, const std::string& work_folder, CommandRunner& commands,
                        bool is_merge_job) {
  const auto state = read_cluster_state(files, work_folder);
  if (!state) return;
  const CancelToken never;
  // A running merge job would resubmit the stopped tasks.
  const bool is_merge_stopped = is_merge_job || stop_merge_job(files, work_folder, commands);
  if (!Slurm(commands, never).cancel(state->task_name()) || !is_merge_stopped)
    throw Error(ErrorCode::kIo, "the tasks may still run: expected 'scancel --name=" +
                                    (is_merge_job ? "" : state->merge_job_name() + ",") +
                                    state->task_name() + "' to succeed");
}

bool stop_merge_job(FileSystem& files, const std::string& work_folder, CommandRunner& commands) {
  const auto state = read_cluster_state(files, work_folder);
  const CancelToken never;
  return !state || Slurm(commands, never).cancel(state->merge_job_name());
}

}  // namespace voxdag
