#include "server/jobs/process/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

#include "core/base/error.h"
#include "core/base/process_limits.h"

namespace voxdag::server {
namespace {

constexpr int kTickMs = 100;
constexpr size_t kMaxOutputLineBytes = 4 << 20;

// Blocks all signals of this thread during the lifetime of this object. A child that is forked
// during that time receives pending signals as soon as it unblocks them. So a stop request that is
// sent right after fork() is not lost.
class BlockedSignals {
 public:
  BlockedSignals() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~BlockedSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  BlockedSignals(const BlockedSignals&) = delete;

 private:
  sigset_t before_;
};

// Resets all signal handlers that the child inherits from the parent to the defaults. Otherwise an
// inherited handler could receive a stop request before exec, and the new program would not learn
// of the request.
void drop_signal_handlers() {
  for (int signal = 1; signal < NSIG; ++signal) {
    struct sigaction action {};
    if (sigaction(signal, nullptr, &action) != 0 || action.sa_handler == SIG_IGN) continue;
    action = {};
    action.sa_handler = SIG_DFL;
    sigaction(signal, &action, nullptr);
  }
}

// Runs the program in the child. Between fork and exec, only async-signal-safe calls are allowed.
[[noreturn]] void run_program(char* const* arguments, int output, const char* log_file, int nice,
                              pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(127);  // the parent died before the line above
  setpgid(0, 0);                        // Ctrl-C on a terminal must only reach the service
  if (nice != 0) setpriority(PRIO_PROCESS, 0, nice);
  drop_signal_handlers();
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  const int null = open("/dev/null", O_RDONLY);
  const int log = open(log_file, O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK, 0640);
  if (null < 0 || log < 0 || dup2(null, 0) < 0 || dup2(output, 1) < 0 || dup2(log, 2) < 0)
    _exit(127);
  close_range(3, ~0U, 0);
  execv(arguments[0], arguments);
  _exit(127);
}

}  // namespace

ChildProcess::ChildProcess(const Start& start) {
  std::vector<char*> arguments;
  for (const std::string& argument : start.command)
    arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    throw Error(ErrorCode::kIo, "cannot start a process: pipe: " + errno_text(errno));
  const pid_t parent = getpid();
  int reason = 0;
  {
    const BlockedSignals blocked;
    pid_ = fork();
    if (pid_ == 0)
      run_program(arguments.data(), ends[1], start.log_file.c_str(), start.nice, parent);
    reason = errno;
  }
  close(ends[1]);
  output_ = ends[0];
  if (pid_ < 0) {
    close(output_);
    throw Error(ErrorCode::kIo, "cannot start a process: fork: " + errno_text(reason));
  }
}

ChildProcess::~ChildProcess() {
  kill();
  wait();
  close(output_);
}

void ChildProcess::read_lines(const std::function<void(std::string_view)>& use,
                              const std::function<bool()>& tick) {
  std::string text;
  char piece[16384];
  for (;;) {
    if (tick()) kill();
    pollfd waiting{output_, POLLIN, 0};
    const int ready = poll(&waiting, 1, kTickMs);
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    const ssize_t got = read(output_, piece, sizeof piece);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return;
    text.append(piece, static_cast<size_t>(got));
    size_t begin = 0;
    for (size_t end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1)
      use(std::string_view(text).substr(begin, end - begin));
    text.erase(0, begin);
    if (text.size() > kMaxOutputLineBytes) text.clear();
  }
}

void ChildProcess::request_stop() { send(SIGTERM); }
void ChildProcess::kill() { send(SIGKILL); }

void ChildProcess::send(int signal) {
  std::lock_guard lock(mutex_);
  if (pid_ > 0) ::kill(pid_, signal);
}

ChildProcess::End ChildProcess::wait() {
  if (pid_ <= 0) return {};
  // Waits for the end of the child without reaping it. Until it is reaped, its process id remains
  // reserved, so no signal can go to another process.
  siginfo_t info{};
  while (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOWAIT) != 0 && errno == EINTR) {
  }
  std::lock_guard lock(mutex_);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  if (WIFSIGNALED(status)) return {0, WTERMSIG(status)};
  return {WEXITSTATUS(status), 0};
}

}  // namespace voxdag::server
