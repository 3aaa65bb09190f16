#include "scheduler/slurm/task_poller.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>
#include <thread>

#include "core/base/clock.h"
#include "core/base/error.h"

namespace voxdag {
namespace {

// Returns the path of the running program. Tasks run the program at this path, so they have the
// same version.
std::string this_program() {
  const std::string path = std::filesystem::read_symlink("/proc/self/exe").string();
  if (!std::filesystem::exists(path))
    throw Error(ErrorCode::kInvalidInput,
                path +
                    ": the file of the running program was replaced or removed, so the tasks of "
                    "the cluster cannot run it: expected the file to remain in place during the "
                    "build (the setting cluster.program of a service can name another file)");
  return path;
}

std::string program_of(const ClusterOptions& options) {
  return options.program_path.empty() ? this_program() : options.program_path;
}

std::string describe(uint32_t batch, const AttemptEnd& attempt) {
  return "batch " + std::to_string(batch) + ", task " + attempt.task +
         (attempt.node.empty() ? "" : " on " + attempt.node) + ": " + attempt.reason;
}

}  // namespace

void TaskPoller::begin_run() {
  batches_.forget_failures();
  for (const OpenBatch& batch : batches_.open())
    if (batch.task) inherited_.insert(batch.number);
}

void TaskPoller::poll() {
  const auto active = cluster_.slurm.active(batches_.state().task_name());
  if (!active) {
    if (is_answering_) cluster_.progress().warn("Slurm does not answer (squeue): waiting for it");
    is_answering_ = false;
    return;
  }
  is_answering_ = true;
  std::set<uint32_t> listed;
  std::vector<SlurmTask> held;
  for (const SlurmTask& task : *active) {
    if (task.is_held()) {
      held.push_back(task);
      continue;
    }
    listed.insert(task.batch());
    warn_waiting(task);
    missing_since_.erase(task.batch());
    update(task);
  }
  cancel_held(held, listed);
  submit(end_missing(listed));
  batches_.show_tasks();
}

void TaskPoller::update(const SlurmTask& task) {
  OpenBatch* const batch = batches_.find(task.batch());
  if (!batch) return;
  // If Slurm lists two tasks of the same batch, the running task is stored.
  if (batch->task && batch->task->name() != task.name() && task.state != "RUNNING") return;
  if (batch->task != task) batches_.mark_changed();
  batch->task = task;
}

// If the task waits for a reason that needs a person to act, warns once for each such reason.
void TaskPoller::warn_waiting(const SlurmTask& task) {
  if (task.state == "PENDING" && !waits_for_its_turn(task.reason) &&
      warned_reasons_.insert(task.reason).second)
    cluster_.progress().warn("task " + task.name() + " waits: " + task.reason);
}

// Cancels tasks that Slurm will never start. If Slurm does not accept the request, adds their
// batches to `listed`, so that end_missing() does not end their attempts. If Slurm accepts, the
// next attempt starts only after the grace period. An immediate attempt could be sent to the same
// faulty node, and fail again.
void TaskPoller::cancel_held(const std::vector<SlurmTask>& tasks, std::set<uint32_t>& listed) {
  std::vector<std::string> names;
  for (const SlurmTask& task : tasks) names.push_back(task.name());
  const bool is_canceled = cluster_.slurm.cancel_tasks(names);
  for (const SlurmTask& task : tasks) {
    OpenBatch* const batch = batches_.find(task.batch());
    if (!is_canceled) listed.insert(task.batch());
    if (!batch || !is_canceled) continue;
    if (!batch->task) batch->task = task;
    if (batch->task->name() == task.name())
      batch->error = {"Slurm could not start it (" + task.reason + ")", false};
  }
}

// `listed` are the batches that have a task in Slurm. Ends the attempts of the other open
// batches whose tasks have ended. Returns the batches to submit, including those without a task.
std::vector<uint32_t> TaskPoller::end_missing(const std::set<uint32_t>& listed) {
  std::vector<uint32_t> to_submit, to_split;
  for (OpenBatch& batch : batches_.open()) {
    if (listed.contains(batch.number)) continue;
    const Next next = !batch.task      ? Next::kResubmit
                      : is_over(batch) ? end_attempt(batch)
                                       : Next::kWait;
    if (next == Next::kStop) break;
    if (next == Next::kResubmit) to_submit.push_back(batch.number);
    if (next == Next::kSplit) to_split.push_back(batch.number);
  }
  for (const uint32_t batch : to_split)
    for (const uint32_t part : batches_.split(batch)) to_submit.push_back(part);
  return to_submit;
}

bool TaskPoller::is_over(const OpenBatch& batch) {
  const double now_s = wall_seconds();
  const Seconds since_s = missing_since_.try_emplace(batch.number, now_s).first->second;
  return (batch.error && batch.error->has_ended) || now_s - since_s >= cluster_.options.grace_s;
}

TaskPoller::Next TaskPoller::end_attempt(OpenBatch& batch) {
  const auto end = cluster_.slurm.end_of(batch.task->name());
  if (!end) return Next::kStop;
  // The task is still active, although squeue did not list it.
  if (end->is_active() && !(batch.error && batch.error->has_ended)) return Next::kWait;
  const bool is_out_of_time = end->state == "TIMEOUT" || end->state == "DEADLINE";
  const bool is_split = is_out_of_time && batches_.can_be_split(batch);
  fail_attempt(batch, *end, is_split);
  return is_split ? Next::kSplit : Next::kResubmit;
}

void TaskPoller::fail_attempt(OpenBatch& batch, const SlurmEnd& end, bool is_split) {
  AttemptEnd attempt{batch.task->name(), end.node.empty() ? batch.task->node : end.node,
                     end.text()};
  if (batch.error) attempt.reason += ": " + batch.error->text;
  batch.error.reset();
  batch.task.reset();
  missing_since_.erase(batch.number);
  batches_.record_failed_attempt();
  const bool is_inherited = inherited_.erase(batch.number) > 0;
  if (!is_split && !is_inherited && end.state != "PREEMPTED") batch.failures.push_back(attempt);
  const std::string what = describe(batch.number, attempt);
  if (batch.failures.size() > cluster_.options.max_retries)
    batches_.give_up(batch.number, ErrorCode::kLimit,
                     what + "; it has failed " + std::to_string(batch.failures.size()) +
                         " times: see the logs in " + cluster_.folder.path());
  cluster_.progress().warn(
      what + (is_split ? "; it is split and submitted again" : "; it is submitted again"));
}

void TaskPoller::submit(const std::vector<uint32_t>& batches) {
  if (batches.empty()) return;
  const ClusterOptions& options = cluster_.options;
  const ClusterFolder folder(absolute_path(cluster_.job.work.path()));
  SlurmArrayRequest request;
  request.name = batches_.state().task_name();
  request.command = {program_of(options), "build-batch", folder.work_folder(), "--batch"};
  request.batches = batches;
  request.log_folder = folder.path();
  request.options = split_words(options.submit_options);
  request.max_running = options.max_running;
  std::map<uint32_t, SlurmTask> tasks;
  std::string refusal;
  try {
    cluster_.slurm.submit(request, tasks);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kIo) throw;
    refusal = error.message();
  }
  for (const auto& [number, task] : tasks) {
    OpenBatch& batch = *batches_.find(number);
    batch.task = task;
    batch.error.reset();
    missing_since_.erase(number);
  }
  batches_.record_submission(unix_seconds());
  batches_.try_save();
  // If sbatch fails, it is still possible that Slurm has accepted the array. The next poll then
  // finds its tasks.
  warn_refusal(refusal);
}

// Warns once while Slurm accepts no tasks. An empty `refusal` means that Slurm accepted the
// submission.
void TaskPoller::warn_refusal(const std::string& refusal) {
  if (!refusal.empty() && is_accepting_)
    cluster_.progress().warn("Slurm accepts no tasks now (" + refusal + "): waiting for it");
  is_accepting_ = refusal.empty();
}

std::string TaskPoller::try_submit_merge_job() {
  if (!batches_.open().empty()) poll();
  std::set<std::string> arrays;
  for (const OpenBatch& batch : batches_.open())
    if (batch.task && !missing_since_.contains(batch.number)) arrays.insert(batch.task->job);
  if (arrays.empty() && !batches_.open().empty()) return "";
  const ClusterOptions& options = cluster_.options;
  SlurmJobRequest request;
  request.name = batches_.state().merge_job_name();
  request.command = options.merge_job->arguments;
  request.command.insert(request.command.begin(), program_of(options));
  request.folder = options.merge_job->folder;
  request.log_folder = absolute_path(cluster_.folder.path());
  request.options = split_words(options.submit_options);
  const std::vector<std::string>& more = options.merge_job->submit_options;
  request.options.insert(request.options.end(), more.begin(), more.end());
  request.after.assign(arrays.begin(), arrays.end());
  try {
    const std::string job = cluster_.slurm.submit_job(request);
    batches_.save();
    return job;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kIo) throw;
    warn_refusal(error.message());
  }
  // If sbatch fails, it is still possible that Slurm has accepted the job.
  return find_job(request.name);
}

// Returns the id of the job with this name; "" if there is none. Repeats the query until Slurm
// answers.
std::string TaskPoller::find_job(const std::string& name) {
  for (;;) {
    if (const auto jobs = cluster_.slurm.jobs(name)) return jobs->empty() ? "" : jobs->front().id;
    cluster_.job.context.cancel.check();
    std::this_thread::sleep_for(std::chrono::duration<double>(cluster_.options.slurm_interval_s));
  }
}

}  // namespace voxdag
