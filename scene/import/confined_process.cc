#include "scene/import/confined_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <new>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/fields/json_text.h"

namespace voxdag {
namespace {

using nlohmann::json;

constexpr int kTickMs = 100;
// Exit statuses of the child process. Before it exits with kFailed, the child sends the error to
// the parent, unless the parent has ended.
constexpr int kDone = 0, kFailed = 1, kNoMemory = 2;

// Returns the size of this process's address space in bytes; 0 if it is unknown.
uint64_t address_space_bytes() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

void write_all(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = write(file, bytes.data(), bytes.size());
    if (n < 0 && errno != EINTR) _exit(kFailed);  // the parent has ended
    if (n > 0) bytes.remove_prefix(static_cast<size_t>(n));
  }
}

// Prepares the child process: limits its memory, and makes it ignore Ctrl-C, because the parent
// handles Ctrl-C and then kills the child. Redirects the standard streams to /dev/null, because
// libraries may print.
void confine(uint64_t memory_bytes, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(kFailed);  // the parent ended before the line above
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, SIG_IGN);
  const int null = open("/dev/null", O_RDWR);
  for (int stream = 0; stream < 3; ++stream) dup2(null, stream);
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  if (VOXDAG_SANITIZED) return;  // the sanitizer needs the address space
  rlimit limit{};
  getrlimit(RLIMIT_AS, &limit);
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, address_space_bytes() + memory_bytes);
  setrlimit(RLIMIT_AS, &limit);
}

[[noreturn]] void run_child(int output, const std::function<void(const SendMessage&)>& work) {
  const auto send = [&](const json& message) {
    write_all(output, ascii_json_text(message) + "\n");
  };
  const auto fail = [&](ErrorCode code, const char* message) {
    send({{"error", error_name(code)}, {"message", message}});
    _exit(kFailed);
  };
  try {
    work(send);
    _exit(kDone);
  } catch (const Error& error) {
    fail(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    _exit(kNoMemory);
  } catch (const std::exception& error) {
    fail(ErrorCode::kInvalidInput, error.what());
  }
  _exit(kFailed);
}

class Child {
 public:
  Child(uint64_t memory_bytes, const std::function<void(const SendMessage&)>& work) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0)
      throw Error(ErrorCode::kIo,
                  "cannot start the process that converts the file: pipe: " + errno_text(errno));
    const pid_t parent = getpid();
    pid_ = fork();
    if (pid_ == 0) {
      close(ends[0]);
      confine(memory_bytes, parent);
      run_child(ends[1], work);
    }
    const std::string reason = errno_text(errno);
    close(ends[1]);
    output_ = ends[0];
    if (pid_ < 0) {
      close(output_);
      throw Error(ErrorCode::kIo,
                  "cannot start the process that converts the file: fork: " + reason);
    }
  }
  ~Child() {
    close(output_);
    if (pid_ < 0) return;
    kill(pid_, SIGKILL);
    wait();
  }
  Child(const Child&) = delete;

  // Calls use(line) for every line of the child's output until the output ends.
  template <class Use>
  void read_lines(const CancelToken& cancel, const Use& use) {
    std::string text;
    char piece[16384];
    for (;;) {
      cancel.check();
      pollfd waiting{output_, POLLIN, 0};
      if (poll(&waiting, 1, kTickMs) <= 0) continue;
      const ssize_t got = read(output_, piece, sizeof piece);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return;
      text.append(piece, static_cast<size_t>(got));
      size_t begin = 0;
      for (size_t end; (end = text.find('\n', begin)) != text.npos; begin = end + 1)
        use(std::string_view(text).substr(begin, end - begin));
      text.erase(0, begin);
    }
  }

  // Waits until the child ends, and returns its status as waitpid() does.
  int wait() {
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    return status;
  }

 private:
  pid_t pid_ = -1;
  int output_ = -1;
};

[[noreturn]] void report_signal(const std::string& what, int signal) {
  if (signal == SIGKILL)
    throw Error(
        ErrorCode::kOutOfMemory,
        what +
            ": the system ended the process that converts the file, probably because memory ran "
            "out: expected more free memory");
  throw Error(ErrorCode::kInvalidInput, what + ": the process that converts the file crashed (" +
                                            strsignal(signal) + "); the file may be damaged, or " +
                                            option_text("memory") + " too small");
}

}  // namespace

void run_confined(const std::string& what, uint64_t memory_bytes,
                  const std::function<void(const SendMessage& send)>& work,
                  const std::function<void(const json& message)>& receive,
                  const CancelToken& cancel) {
  Child child(memory_bytes, work);
  json error;
  child.read_lines(cancel, [&](std::string_view line) {
    json message = try_parse_json<json>(line);
    if (!message.is_object()) return;
    if (message.contains("error"))
      error = std::move(message);
    else
      receive(message);
  });
  const int status = child.wait();
  if (WIFSIGNALED(status)) report_signal(what, WTERMSIG(status));
  if (WEXITSTATUS(status) == kNoMemory)
    throw Error(ErrorCode::kOutOfMemory, what + ": takes more memory than the limit, " +
                                             size_text(memory_bytes) + ": expected a higher " +
                                             option_text("memory"));
  if (WEXITSTATUS(status) == kDone) return;
  if (error.is_null())
    throw Error(ErrorCode::kIo, what + ": the process that converts the file ended with status " +
                                    std::to_string(WEXITSTATUS(status)) +
                                    " and no message: please report this defect with the file");
  throw Error(error_code_named(error["error"].get<std::string>()).value_or(ErrorCode::kIo),
              error["message"].get<std::string>());
}

}  // namespace voxdag
