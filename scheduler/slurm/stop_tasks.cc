#include "core/base/error.h"
#include "scheduler/cluster/cluster.h"
#include "scheduler/slurm/cluster_context.h"
#include "scheduler/slurm/files/cluster_state.h"

namespace voxdag {
namespace {

// Cancels the work folder's merge job, if any. Returns false if Slurm does not accept the request.
bool stop_merge_job(FileSystem& files, const std::string& work_folder, CommandRunner& commands) {
  const auto state = read_cluster_state(files, work_folder);
  const CancelToken never;
  return !state || Slurm(commands, never).cancel(state->merge_job_name());
}

void stop_with(CommandRunner& commands, FileSystem& files, const std::string& work_folder,
               bool is_merge_job) {
  const auto state = read_cluster_state(files, work_folder);
  if (!state) return;
  const CancelToken never;
  // A running merge job would resubmit the stopped tasks.
  const bool is_merge_stopped = is_merge_job || stop_merge_job(files, work_folder, commands);
  if (!Slurm(commands, never).cancel(state->task_name()) || !is_merge_stopped)
    throw Error(ErrorCode::kIo,
                work_folder +
                    ": scancel failed, so the tasks may still run: expected 'scancel --name=" +
                    (is_merge_job ? "" : state->merge_job_name() + ",") + state->task_name() +
                    "' to succeed");
}

}  // namespace

void stop_cluster_tasks(FileSystem& files, const std::string& work_folder, bool is_merge_job) {
  stop_with(system_commands(), files, work_folder, is_merge_job);
}

void stop_earlier_merge_job(const BuildSpec& spec, const BuildContext& context) {
  try {
    stop_merge_job(context.files, work_folder_of(spec.run), commands_of(spec));
  } catch (const Error& error) {
    context.progress.warn(error.message() + "; its tasks may still run");
  }
}

void remove_tasks(BuildJob& job) {
  if (!job.context.files.exists(job.work.cluster_path())) return;
  try {
    stop_with(commands_of(job.spec), job.context.files, job.work.path(), is_merge_job(job.spec));
  } catch (const Error& error) {
    job.context.progress.warn(error.message());
  }
  job.work.remove_cluster_files();
}

}  // namespace voxdag
