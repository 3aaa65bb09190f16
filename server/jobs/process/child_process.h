// A process of ours: started, read line by line, asked to stop, waited for. It dies with this one,
// however that ends, and holds none of its files.
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
    std::string log_file;              // its standard error is added to that
    int nice = 0;
  };
  // Must be called by a thread that lives until wait() has returned: the child is tied to it.
  // Throws Error{kIo} if no process can be made; a program that cannot be run ends with status 127.
  explicit ChildProcess(const Start& start);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;

  // Hands every line of its standard output to `use` until the output ends. Calls `tick` at least
  // every tenth of a second; when that returns true the child is killed.
  void read_lines(const std::function<void(std::string_view line)>& use,
                  const std::function<bool()>& tick);
  // SIGTERM: a build stops at a checkpoint. From any thread.
  void ask_to_stop() { signal(true); }
  void kill() { signal(false); }

  struct End {
    int exit_status = 0;
    int signal = 0;  // that ended it; 0 for none
  };
  End wait();

 private:
  void signal(bool ask);

  std::mutex mutex_;  // guards pid_: no signal goes to a process that was waited for
  pid_t pid_ = -1;
  int output_ = -1;
};

}  // namespace voxdag::server
