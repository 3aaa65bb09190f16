#include "scheduler/slurm/commands/command_runner.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/process_limits.h"

extern char** environ;

namespace voxdag {
namespace {

[[noreturn]] void fail(const std::string& what, int error) {
  throw Error(ErrorCode::kIo, what + ": " + errno_text(error));
}

// A pipe, read from end 0 and written to end 1. Its destructor and exec() close both ends.
class Pipe {
 public:
  explicit Pipe(const std::string& command) {
    if (pipe2(ends_.data(), O_CLOEXEC) != 0) fail("cannot start " + command + ": pipe", errno);
  }
  ~Pipe() {
    close_end(0);
    close_end(1);
  }
  int end(int i) const { return ends_[static_cast<size_t>(i)]; }
  void close_end(int i) {
    int& fd = ends_[static_cast<size_t>(i)];
    if (fd >= 0) ::close(fd);
    fd = -1;
  }
  // Makes end `i`, which this process uses, nonblocking.
  void unblock(int i) { fcntl(end(i), F_SETFL, O_NONBLOCK); }

 private:
  std::array<int, 2> ends_{-1, -1};
};

class FileActions {
 public:
  FileActions() { posix_spawn_file_actions_init(&actions_); }
  ~FileActions() { posix_spawn_file_actions_destroy(&actions_); }
  void duplicate(int from, int to) { posix_spawn_file_actions_adddup2(&actions_, from, to); }
  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_;
};

class Attributes {
 public:
  // Resets the signals below to their default actions in the started program. Otherwise the program
  // would ignore those signals that this process ignores.
  Attributes() {
    posix_spawnattr_init(&attributes_);
    sigset_t defaults;
    sigemptyset(&defaults);
    for (const int signal : {SIGPIPE, SIGXFSZ, SIGINT}) sigaddset(&defaults, signal);
    posix_spawnattr_setsigdefault(&attributes_, &defaults);
    posix_spawnattr_setpgroup(&attributes_, 0);
    // Starts the command in a separate process group, so that Ctrl-C does not kill it.
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~Attributes() { posix_spawnattr_destroy(&attributes_); }
  const posix_spawnattr_t* get() const { return &attributes_; }

 private:
  posix_spawnattr_t attributes_;
};

// Reads the bytes that `fd` has now, and appends them to `out`. Returns false at the end of the
// program's output.
bool read_some(int fd, std::string& out) {
  std::array<char, 65536> buffer;
  const ssize_t n = ::read(fd, buffer.data(), buffer.size());
  if (n > 0) out.append(buffer.data(), static_cast<size_t>(n));
  return n > 0 || (n < 0 && (errno == EAGAIN || errno == EINTR));
}

// Writes as much as the pipe accepts. Returns false if all of `text` is written or the reader has
// closed the pipe.
bool write_some(int fd, const std::string& text, size_t& written) {
  if (written < text.size()) {
    const ssize_t n = ::write(fd, text.data() + written, text.size() - written);
    if (n > 0) written += static_cast<size_t>(n);
    if (n < 0 && errno != EAGAIN && errno != EINTR) return false;
  }
  return written < text.size();
}

class SystemCommands : public CommandRunner {
 public:
  CommandResult run(const std::vector<std::string>& command, const std::string& input,
                    double timeout_s, const CancelToken& cancel) override {
    Pipe in(command[0]), out(command[0]), err(command[0]);
    FileActions actions;
    actions.duplicate(in.end(0), 0);
    actions.duplicate(out.end(1), 1);
    actions.duplicate(err.end(1), 2);
    const Attributes attributes;
    std::vector<char*> arguments;
    for (const std::string& argument : command)
      arguments.push_back(const_cast<char*>(argument.c_str()));
    arguments.push_back(nullptr);
    std::vector<char*> environment;
    for (char** variable = environ; *variable; ++variable)
      if (!is_hidden_variable(*variable)) environment.push_back(*variable);
    environment.push_back(nullptr);
    pid_t pid = 0;
    const int failure = posix_spawnp(&pid, arguments[0], actions.get(), attributes.get(),
                                     arguments.data(), environment.data());
    if (failure == ENOENT) return {127, "", command[0] + ": command not found"};
    if (failure != 0) fail("cannot start " + command[0], failure);
    in.close_end(0);
    out.close_end(1);
    err.close_end(1);
    in.unblock(1);
    out.unblock(0);
    err.unblock(0);
    CommandResult result;
    exchange(in, out, err, input, pid, wall_seconds() + timeout_s, cancel, result);
    int status = 0;
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR) continue;
    cancel.check();
    result.exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return result;
  }

 private:
  static void exchange(Pipe& in, Pipe& out, Pipe& err, const std::string& input, pid_t pid,
                       double end_s, const CancelToken& cancel, CommandResult& result) {
    size_t written = 0;
    bool is_killed = false;
    while (out.end(0) >= 0 || err.end(0) >= 0) {
      std::array<pollfd, 3> waits{
          {{in.end(1), POLLOUT, 0}, {out.end(0), POLLIN, 0}, {err.end(0), POLLIN, 0}}};
      poll(waits.data(), waits.size(), 100);
      if (waits[0].revents && !write_some(in.end(1), input, written)) in.close_end(1);
      if (waits[1].revents && !read_some(out.end(0), result.output)) out.close_end(0);
      if (waits[2].revents && !read_some(err.end(0), result.error)) err.close_end(0);
      if (wall_seconds() < end_s && !(cancel.canceled() && !is_killed)) continue;
      if (is_killed) return;  // Only a child of the killed program still has the output open.
      kill(-pid, SIGKILL);
      is_killed = true;
      end_s = wall_seconds() + 1;
    }
  }
};

}  // namespace

bool is_hidden_variable(std::string_view variable) {
  for (const std::string_view shown : {"SLURM_CONF=", "SLURM_CLUSTERS=", "SLURM_JWT="})
    if (variable.starts_with(shown)) return false;
  for (const std::string_view prefix :
       {"SLURM_", "SLURMD_", "SQUEUE_", "SCANCEL_", "SACCT_", "SCONTROL_", "SBATCH_WAIT",
        "SBATCH_ARRAY_INX", "SBATCH_CLUSTERS", "SBATCH_JOB_NAME"})
    if (variable.starts_with(prefix)) return true;
  return false;
}

CommandRunner& system_commands() {
  static SystemCommands commands;
  return commands;
}

}  // namespace voxdag
