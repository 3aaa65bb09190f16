// Runs commands, such as Slurm's, without a shell and returns their output.
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
  // Runs a program from PATH with `input` as its standard input. A program that takes longer than
  // `timeout_s` is killed; its exit status is 128 + 9. The program gets this process's environment
  // except for hidden variables (is_hidden_variable()). Throws Error{kIo} if no process can be
  // started. Kills the program and throws Error{kCanceled} when `cancel` is canceled.
  virtual CommandResult run(const std::vector<std::string>& command, const std::string& input,
                            double timeout_s, const CancelToken& cancel) = 0;
};

CommandRunner& system_commands();

// True for an environment variable that commands do not get, because it changes the behavior of
// Slurm's commands or describes the Slurm job of this process. Submitted tasks must not inherit the
// description of this job. `variable` is NAME=value.
bool is_hidden_variable(std::string_view variable);

}  // namespace voxdag
