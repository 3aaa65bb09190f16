// Runs work in a separate process that may be killed.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace voxdag {

// Runs work() in a child process. Returns true if SIGKILL ended the process. work() must not need
// threads that already run.
template <class Work>
bool is_killed(const Work& work) {
  const pid_t child = fork();
  if (child == 0) {
    work();
    _exit(0);
  }
  int status = 0;
  return waitpid(child, &status, 0) == child && WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
}

}  // namespace voxdag
