// What a cluster build asks of Slurm, through its commands: sbatch, squeue, scontrol, scancel and,
// where there is accounting, sacct. Used by one thread.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "scheduler/slurm/commands/command_runner.h"

namespace voxdag {

// A task or job is_given_up() if Slurm could not start it and holds it until an operator releases
// it: it waits for ever. After a crash slurmctld may give new tasks the ids of tasks that nodes
// still know; these refuse them.

// A task of an array is JOB_INDEX, for the user and for Slurm.
struct SlurmTask {
  std::string job;
  uint32_t index = 0;
  std::string state;   // "PENDING", "RUNNING", ...
  std::string reason;  // why it waits
  std::string node;    // "" before it runs
  uint32_t first_batch = 0;

  uint32_t batch() const { return first_batch + index; }
  std::string name() const { return job + "_" + std::to_string(index); }
  bool is_given_up() const;
  bool operator==(const SlurmTask&) const = default;
};

// How a task ended.
struct SlurmEnd {
  std::string state;  // "TIMEOUT", "OUT_OF_MEMORY", "NODE_FAIL", ...; "" if Slurm has forgotten it
  std::string reason;
  std::string node;
  std::string exit_code;  // STATUS:SIGNAL

  std::string text() const;
  // Whether the task has not ended: it waits, runs or ends just now.
  bool is_active() const;
};

struct ArrayRequest {
  std::string name;  // by which its tasks are found again
  // Each task runs `command` followed by the number of its batch.
  std::vector<std::string> command;
  std::vector<uint32_t> batches;
  std::string log_folder;
  std::vector<std::string> options;  // of sbatch, the user's
  uint64_t max_running = 0;          // tasks at a time; 0 for no limit
};

// A job of its own, no array.
struct JobRequest {
  std::string name;
  std::vector<std::string> command;
  std::vector<std::string> after;  // jobs that have to end first
  std::string folder;              // in which the command runs
  std::string log_folder;
  std::vector<std::string> options;  // of sbatch
};

struct SlurmJob {
  std::string id;
  std::string state;
  std::string reason;  // why it waits
  bool is_given_up() const;
};

class Slurm {
 public:
  // `cancel` ends a command that runs. For some seconds after its start Slurm knows no nodes, and
  // says that no node is like those asked for: that is believed after `start_s` only.
  Slurm(CommandRunner& commands, const CancelToken& cancel, double start_s = 0)
      : commands_(commands), cancel_(cancel), start_s_(start_s) {}

  // Throws Error{kInvalidInput} if there is no Slurm here, or if sbatch would refuse these options.
  // Asks again every `pause_s` while Slurm may not know its nodes yet, with a warning.
  void check(const std::vector<std::string>& options, double pause_s, Progress& progress);
  // Submits arrays, several if the numbers of the batches differ by more than Slurm's MaxArraySize,
  // and adds the task of each batch to `tasks` as soon as its array is accepted. Throws
  // Error{kInvalidInput} with sbatch's message if it refuses, Error{kIo} if Slurm does not answer
  // or cannot take it now: then the array may be there or not.
  void submit(const ArrayRequest& request, std::map<uint32_t, SlurmTask>& tasks);
  // All tasks of that name that wait or run; nothing if Slurm does not answer now.
  std::optional<std::vector<SlurmTask>> active(const std::string& name);
  // Submits a job and returns its id. Throws as submit() does.
  std::string submit_job(const JobRequest& request);
  // All jobs of that name that wait or run; nothing if Slurm does not answer now.
  std::optional<std::vector<SlurmJob>> jobs(const std::string& name);
  // How a task JOB_INDEX or a job ended; nothing if Slurm does not answer now.
  std::optional<SlurmEnd> end_of(const std::string& task);
  // Cancels all tasks and jobs of that name. Returns whether Slurm has taken it.
  bool cancel(const std::string& name);
  // Cancels tasks JOB_INDEX and jobs.
  bool cancel_tasks(const std::vector<std::string>& tasks);
  // Commands so far.
  uint64_t requests() const { return requests_; }

 private:
  static constexpr double kTimeout_s = 60;

  CommandResult run(const std::vector<std::string>& command, const std::string& input = "");
  // The job's id that sbatch printed, JOB or JOB;CLUSTER.
  std::string accepted_job(const CommandResult& submitted);
  // A setting of slurm.conf, "" if unknown.
  std::string setting(const std::string& name);
  // Whether Slurm refused for want of nodes that it may not know yet.
  bool may_be_starting(const CommandResult& refused);

  CommandRunner& commands_;
  const CancelToken& cancel_;
  const double start_s_;
  std::optional<double> without_nodes_since_s_;  // since Slurm refused so for the first time
  uint64_t requests_ = 0;
  std::optional<std::string> configuration_;
};

// Whether what waits for this reason need only wait; not so if a person has to do something.
bool waits_for_its_turn(const std::string& reason);

// The words of a text as a shell would split it: at blanks, but not within quotes; a backslash
// takes the next character as it is. Throws Error{kInvalidInput} for a quote that is not closed.
std::vector<std::string> split_words(const std::string& text);

}  // namespace voxdag
