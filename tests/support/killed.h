// Runs work in a separate process that may be killed.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace voxdag {

// True if work(), run in a child process, was ended by SIGKILL. It must not need threads that run
// already.
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
