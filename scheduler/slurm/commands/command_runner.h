// Runs the commands of another program, such as Slurm's, and returns what they print. No shell is
// involved.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "voxdag/cancel_token.h"

namespace voxdag {

struct CommandResult {
  int exit_status = 0;  // 127 if there is no such program, 128 + n after signal n
  std::string output, error;
};

class CommandRunner {
 public:
  virtual ~CommandRunner() = default;
  // Runs a program of the PATH with `input` as its standard input; one that takes longer than
  // `timeout_s` is killed, which is an exit status of 128 + 9. It gets this process's environment
  // but for what a Slurm job around it, or settings of other commands, would change
  // (is_hidden_variable()). Throws Error{kIo} if no process can be started, Error{kCanceled} once
  // `cancel` is canceled; the program is killed then.
  virtual CommandResult run(const std::vector<std::string>& command, const std::string& input,
                            double timeout_s, const CancelToken& cancel) = 0;
};

CommandRunner& system_commands();

// A variable, NAME=value, that would make Slurm's commands do something else than they were asked
// to, or that describes a job around this process to the tasks that it submits.
bool is_hidden_variable(std::string_view variable);

}  // namespace voxdag
