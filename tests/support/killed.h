// Runs work in a separate process that may be killed.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace voxdag {

// Runs work() in a child process. Returns true if SIGKILL ended the child. work() must not rely on
// other threads of the parent, because fork() does not copy them.
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
