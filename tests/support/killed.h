// Runs work in a separate process that may be killed.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace voxdag {

// Runs work() in a child process. Returns true if SIGKILL ended the child. work() must not use
// threads of the parent, because the child does not have them.
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
