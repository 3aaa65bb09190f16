#include "cli/terminal/signals.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "core/io/temporary_paths.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::cli {
namespace {

using Clock = std::chrono::steady_clock;

// Runs `command` in a child process in which catch_signals() handles signals and which has just
// received SIGTERM. So the command's token is canceled. The process calls `prepare` before the
// signal. Returns the exit status of the process.
int interrupted(
    const std::function<void(CancelToken& cancel)>& command,
    const std::function<void()>& prepare = [] {}) {
  const pid_t child = fork();
  if (child == 0) {
    static CancelToken cancel;
    catch_signals(cancel);
    prepare();
    raise(SIGTERM);
    command(cancel);
    _exit(0);
  }
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

void sleep_for_seconds(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

// A command that never checks its CancelToken ends within 10 s of the signal. Its status is 130,
// and its temporary files are removed.
TEST(Signals, EndACommandThatDoesNotStop) {
  const TemporaryFolder folder;
  const std::string file = folder.file("out.partial"), work = folder.file("work");
  const auto start = Clock::now();
  EXPECT_EQ(interrupted([&](CancelToken&) {
              std::ofstream(file) << "a part";
              std::filesystem::create_directories(work + "/inner");
              const TemporaryPath registered_file(file), registered_folder(work);
              sleep_for_seconds(60);
            }),
            130);
  EXPECT_LT(std::chrono::duration<double>(Clock::now() - start).count(), 10);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Signals, LetACommandStopByItself) {
  EXPECT_EQ(interrupted([](CancelToken& cancel) { _exit(cancel.canceled() ? 7 : 8); }), 7);
}

TEST(Signals, LetAServerCompleteItsAnswers) {
  const auto answer = [](CancelToken&) {
    sleep_for_seconds(3 * kMaxStopS);
    _exit(7);
  };
  EXPECT_EQ(interrupted(answer, allow_slow_stop), 7);
}

TEST(Signals, TheSecondOneEndsTheProcess) {
  EXPECT_EQ(interrupted([](CancelToken&) {
              raise(SIGINT);
              sleep_for_seconds(60);
            }),
            128 + SIGINT);
}

TEST(Signals, FileSizeLimitsAndClosedPipesAreErrors) {
  EXPECT_EQ(interrupted([](CancelToken&) {
              raise(SIGXFSZ);
              raise(SIGPIPE);
              _exit(7);
            }),
            7);
}

}  // namespace
}  // namespace voxdag::cli
