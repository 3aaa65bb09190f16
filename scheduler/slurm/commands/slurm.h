// Requests of a cluster build to Slurm through its commands: sbatch, squeue, scontrol, scancel and,
// if accounting is enabled, sacct. Used by one thread.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "scheduler/slurm/commands/command_runner.h"

namespace voxdag {

// is_held() of a task or job is true if Slurm could not start it and holds it until an operator
// releases it. This happens, for example, if Slurm's controller (slurmctld) reuses the ids of tasks
// after a crash: nodes that still know the earlier tasks refuse the new ones.

// A task of an array. Its name is JOB_INDEX, for the user and for Slurm.
struct SlurmTask {
  std::string job;
  uint32_t index = 0;
  std::string state;         // "PENDING", "RUNNING", ...
  std::string reason;        // why the task waits
  std::string node;          // "" before the task runs
  uint32_t first_batch = 0;  // number of the batch with index 0

  uint32_t batch() const { return first_batch + index; }
  std::string name() const { return job + "_" + std::to_string(index); }
  bool is_held() const;
  bool operator==(const SlurmTask&) const = default;
};

// How a task ended.
struct SlurmEnd {
  std::string state;  // "TIMEOUT", "OUT_OF_MEMORY", "NODE_FAIL", ...; "" if Slurm has forgotten it
  std::string reason;
  std::string node;
  std::string exit_code;  // STATUS:SIGNAL

  std::string text() const;
  // True if the task has not ended: it waits, runs or is completing.
  bool is_active() const;
};

struct SlurmArrayRequest {
  std::string name;  // name by which active() finds the tasks
  // Each task runs `command` followed by the number of its batch.
  std::vector<std::string> command;
  std::vector<uint32_t> batches;
  std::string log_folder;
  std::vector<std::string> options;  // sbatch options of the user
  uint64_t max_running = 0;          // max concurrent tasks; 0 for no limit
};

// A single job, not an array.
struct SlurmJobRequest {
  std::string name;
  std::vector<std::string> command;
  std::vector<std::string> after;  // jobs that must end first
  std::string folder;              // working directory of the command
  std::string log_folder;
  std::vector<std::string> options;  // sbatch options
};

struct SlurmJob {
  std::string id;
  std::string state;
  std::string reason;  // why the job waits
  bool is_held() const;
};

class Slurm {
 public:
  // Canceling `cancel` ends a running command. For some seconds after Slurm was started, it knows
  // no nodes and refuses all submissions. Such a refusal counts as temporary for `start_s` seconds
  // after the first one: check() repeats its request, and submissions throw Error{kIo}, so that the
  // caller tries again later.
  Slurm(CommandRunner& commands, const CancelToken& cancel, double start_s = 0)
      : commands_(commands), cancel_(cancel), start_s_(start_s) {}

  // Throws Error{kInvalidInput} if Slurm is not installed, or if sbatch would refuse these options.
  // Repeats the request every `pause_s` seconds, after one warning, while it is possible that Slurm
  // does not know its nodes yet.
  void check(const std::vector<std::string>& options, double pause_s, Progress& progress);
  // Submits the batches as one array, or as several if Slurm's limits require this (such as
  // MaxArraySize, the limit of an index). Adds each batch's task to `tasks` as soon as its array is
  // accepted. Throws Error{kInvalidInput} with sbatch's message if sbatch refuses the array. Throws
  // Error{kIo} if Slurm does not answer or cannot accept the array now. In this case, it is
  // possible that the array exists nevertheless.
  void submit(const SlurmArrayRequest& request, std::map<uint32_t, SlurmTask>& tasks);
  // Returns the waiting and running tasks with this name; nullopt if Slurm does not answer.
  std::optional<std::vector<SlurmTask>> active(const std::string& name);
  // Submits a job and returns its id. Throws as submit() does.
  std::string submit_job(const SlurmJobRequest& request);
  // Returns the waiting and running jobs with this name; nullopt if Slurm does not answer.
  std::optional<std::vector<SlurmJob>> jobs(const std::string& name);
  // Returns how a task JOB_INDEX or a job ended; nullopt if Slurm does not answer.
  std::optional<SlurmEnd> end_of(const std::string& task);
  // Cancels all tasks and jobs with this name. Returns true if Slurm accepts the request.
  bool cancel(const std::string& name);
  // Cancels tasks (JOB_INDEX) and jobs.
  bool cancel_tasks(const std::vector<std::string>& tasks);
  // Number of commands run.
  uint64_t requests() const { return requests_; }

 private:
  static constexpr double kTimeoutS = 60;

  CommandResult run(const std::vector<std::string>& command, const std::string& input = "");
  // Returns the job's id from sbatch's output, JOB or JOB;CLUSTER.
  std::string accepted_job(const CommandResult& submitted);
  // Returns a setting of slurm.conf, "" if unknown.
  std::string setting(const std::string& name);
  // True if Slurm refused the request because of missing nodes, at most start_s_ seconds after the
  // first such refusal. It is then possible that Slurm has just started and does not know its nodes
  // yet.
  bool may_be_starting(const CommandResult& refused);

  CommandRunner& commands_;
  const CancelToken& cancel_;
  const double start_s_;
  std::optional<double> without_nodes_since_s_;  // time of the first refusal
                                                 // because of missing nodes
  uint64_t requests_ = 0;
  std::optional<std::string> configuration_;
};

// True if a task that waits for this reason will start without help. False if it is possible that a
// person must act first.
bool waits_for_its_turn(const std::string& reason);

// Splits a text into words as a shell does: at blanks outside of quotes. A backslash outside of
// single quotes escapes the next character. Throws Error{kInvalidInput} for an unterminated quote.
std::vector<std::string> split_words(const std::string& text);

}  // namespace voxdag
