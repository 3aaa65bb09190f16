#include "cli/terminal/signals.h"

#include <semaphore.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <system_error>
#include <thread>

#include "core/base/error.h"
#include "core/io/temporary_paths.h"

namespace voxdag::cli {
namespace {

CancelToken* g_signal_token = nullptr;
sem_t g_signaled;
std::atomic<bool> g_may_stop_slowly{false};

void on_signal(int signal) {
  if (g_signal_token->canceled()) _Exit(128 + signal);
  g_signal_token->cancel();
  const int before = errno;
  sem_post(&g_signaled);
  errno = before;
}

// Runs on its own thread. Waits for the first signal, and ends the process if the command has not
// ended kMaxStopS later. Does nothing if allow_slow_stop() was called.
void end_after_signal() {
  while (sem_wait(&g_signaled) != 0) {
  }
  if (g_may_stop_slowly) return;
  std::this_thread::sleep_for(std::chrono::duration<double>(kMaxStopS));
  remove_temporary_paths();
  std::fprintf(stderr, "voxdag: error: canceled; the last step was not completed\n");
  _Exit(exit_status(ErrorCode::kCanceled));
}

void start_thread() {
  try {
    std::thread(end_after_signal).detach();
  } catch (const std::system_error&) {
    // The system allows no more threads. The command can then end only by its own checks of the
    // token, or by a second signal.
  }
}

}  // namespace

void catch_signals(CancelToken& cancel) {
  g_signal_token = &cancel;
  sem_init(&g_signaled, 0, 0);
  start_thread();
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // SIGHUP means that the terminal was closed. If nohup has started the program, SIGHUP is already
  // ignored. Then it remains ignored.
  struct sigaction hangup {};
  sigaction(SIGHUP, nullptr, &hangup);
  if (hangup.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  // By default, these two signals end the process when it writes to a closed pipe or beyond the
  // limit of file sizes. If they are ignored, the write fails instead, and the command reports the
  // error. (If the reader of standard output has closed the pipe, main() ends the process without a
  // message.)
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

void allow_slow_stop() { g_may_stop_slowly = true; }

}  // namespace voxdag::cli
