// A child process: started, read line by line, asked to stop, waited for. It dies with this
// process, however that ends, and inherits none of its open files.
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
    std::string log_file;              // its standard error is appended to this file
    int nice = 0;
  };
  // Must be called by a thread that lives until wait() has returned: the child is tied to it.
  // Throws Error{kIo} if no process can be made. A program that cannot be run ends with status 127.
  explicit ChildProcess(const Start& start);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;

  // Calls `use` for every line of its standard output until the output ends, and `tick` at least
  // every tenth of a second; when `tick` returns true the child is killed.
  void read_lines(const std::function<void(std::string_view line)>& use,
                  const std::function<bool()>& tick);
  // Sends SIGTERM, upon which a build stops at a checkpoint; a program that has not begun yet ends.
  // From any thread.
  void request_stop();
  void kill();

  struct End {
    int exit_status = 0;
    int signal = 0;  // the signal that ended it, 0 for none
  };
  End wait();

 private:
  void send(int signal);

  std::mutex mutex_;  // guards pid_, so that no signal goes to a reaped process
  pid_t pid_ = -1;
  int output_ = -1;
};

}  // namespace voxdag::server
