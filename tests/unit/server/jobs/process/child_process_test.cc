#include "server/jobs/process/child_process.h"

#include <gtest/gtest.h>

#include <csignal>

#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

// Installs a handler of SIGTERM, as `voxdag serve` does.
class HandlesTerm {
 public:
  HandlesTerm() {
    before_ = std::signal(SIGTERM, [](int) {});
  }
  ~HandlesTerm() { std::signal(SIGTERM, before_); }

 private:
  void (*before_)(int);
};

// request_stop() ends a child even before the child has started its program. Between fork and exec,
// the child would otherwise handle the signal with this program's handler, and the stop would be
// lost.
TEST(ChildProcesses, AreStoppedBeforeTheirProgramBegins) {
  const TemporaryFolder folder;
  const HandlesTerm handler;
  for (int i = 0; i < 20; ++i) {
    ChildProcess child({{"/bin/sleep", "10"}, folder.file("log"), 0});
    child.request_stop();
    child.read_lines([](std::string_view) {}, [] { return false; });
    const ChildProcess::End end = child.wait();
    ASSERT_EQ(end.signal, SIGTERM) << "child " << i << " ended with status " << end.exit_status;
  }
}

// Starting a child process does not change the signal mask of the calling thread.
TEST(ChildProcesses, LeaveTheSignalsOfTheirParentAsTheyWere) {
  const TemporaryFolder folder;
  sigset_t before, after;
  pthread_sigmask(SIG_BLOCK, nullptr, &before);
  ChildProcess child({{"/bin/true"}, folder.file("log"), 0});
  pthread_sigmask(SIG_BLOCK, nullptr, &after);
  for (int signal = 1; signal < NSIG; ++signal)
    EXPECT_EQ(sigismember(&after, signal), sigismember(&before, signal)) << signal;
  child.read_lines([](std::string_view) {}, [] { return false; });
  EXPECT_EQ(child.wait().exit_status, 0);
}

// If the parent ignores SIGHUP, as in `nohup voxdag serve`, the child also ignores it.
TEST(ChildProcesses, IgnoreWhatTheirParentIgnores) {
  const TemporaryFolder folder;
  const auto before = std::signal(SIGHUP, SIG_IGN);
  ChildProcess child({{"/bin/sh", "-c", "kill -HUP $$; echo on"}, folder.file("log"), 0});
  std::string said;
  child.read_lines([&](std::string_view line) { said += line; }, [] { return false; });
  EXPECT_EQ(child.wait().signal, 0);
  EXPECT_EQ(said, "on");
  std::signal(SIGHUP, before);
}

}  // namespace
}  // namespace voxdag::server
