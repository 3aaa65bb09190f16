// A child process: starts it, reads its output line by line, requests its stop, and waits for it.
// The child dies with this process, even if this process crashes. The child inherits no open files
// of this process.
#pragma once

#include <sys/types.h>

#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace voxdag::server {

class ChildProcess {
 public:
  struct Start {
    std::vector<std::string> command;  // program and arguments
    std::string log_file;              // the child's standard error is appended to this file
    int nice = 0;
  };
  // The calling thread must live until wait() has returned, because the child dies with this
  // thread. Throws Error{kIo} if no process can be created. If the program cannot be run, the child
  // ends with status 127.
  explicit ChildProcess(const Start& start);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;

  // Calls `use` for every line of the child's standard output until the output ends, and `tick` at
  // least every tenth of a second. When `tick` returns true, the child is killed.
  void read_lines(const std::function<void(std::string_view line)>& use,
                  const std::function<bool()>& tick);
  // Sends SIGTERM. A build then stops at its next checkpoint. A child that has not started its
  // program yet ends immediately. May be called from any thread.
  void request_stop();
  // Sends SIGKILL. May be called from any thread.
  void kill();

  struct End {
    int exit_status = 0;
    int signal = 0;  // number of the signal that ended the child; 0 if it exited by itself
  };
  // Waits until the child ends. Returns End{} if the child was already waited for.
  End wait();

 private:
  void send(int signal);

  std::mutex mutex_;  // guards pid_, so that no signal goes to a reaped process
  pid_t pid_ = -1;
  int output_ = -1;
};

}  // namespace voxdag::server
