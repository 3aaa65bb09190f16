// No command replaces a file that another program creates at the output while the command runs.
#include <signal.h>
#include <time.h>

#include <filesystem>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class AppearingOutput : public CommandLine {
 protected:
  void SetUp() override {
    ASSERT_EQ(run({"generate", "soup", "s.glb", "--triangles", "20000"}).status, 0);
    ASSERT_EQ(run({"build", "s.glb", "-r", "1024", "-o", "s.vdag"}).status, 0);
  }
  static void sleep_ms(int ms) {
    const timespec t{ms / 1000, ms % 1000 * 1000000};
    nanosleep(&t, nullptr);
  }
  // Starts a command, and waits until it has created the file `sign`. Commands create this file
  // after they have checked that the output does not exist. Then creates the file `appears`, as
  // another program would. Expects that the command fails and keeps `appears`.
  void expect_kept(const std::string& appears, const std::string& sign,
                   const std::vector<std::string>& args) {
    SCOPED_TRACE(args[0] + ": " + appears);
    const pid_t pid = start(args);
    for (int i = 0; i < 30000 && !exists(sign) && kill(pid, 0) == 0; ++i) sleep_ms(1);
    kill(pid, SIGSTOP);
    const bool was_early = exists(sign) && !exists(appears);
    if (was_early) put(appears, "theirs");
    kill(pid, SIGCONT);
    const Answer answer = wait_for(pid);
    ASSERT_TRUE(was_early) << "the command was too fast for this test";
    EXPECT_EQ(answer.status, 2) << answer.err;
    EXPECT_EQ(contents(appears), "theirs");
    std::filesystem::remove(folder_.file(appears));
  }
};

TEST_F(AppearingOutput, IsKept) {
  const auto build = [](const std::string& output) {
    return std::vector<std::string>{"build", "s.glb",     "-r", "2048",        "-o",
                                    output,  "--threads", "1",  "--subvolume", "256"};
  };
  expect_kept("b", "b.work/lock", build("b"));
  EXPECT_EQ(run(build("b")).status, 0);  // resumes
  expect_kept("c.partial", "c.work/lock", build("c"));
  expect_kept("d.report.json", "d.work/lock", build("d"));
  expect_kept("x", "x.lock", {"extract", "s.vdag", "-o", "x", "--threads", "1"});
  expect_kept("e", "e.partial", {"export", "s.vdag", "--to", "ply", "-o", "e"});
  expect_kept("g", "g.partial", {"generate", "soup", "g", "--triangles", "5000000"});
}

// Before the picture is complete, render creates no file that could show that its checks are done.
// So the test creates the output after 1.5 s. The command fails and keeps the file of the other
// program.
TEST_F(AppearingOutput, OfRenderIsKept) {
  const pid_t pid = start(
      {"render", "s.vdag", "-o", "r.png", "--size", "256x256", "--threads", "1", "--samples", "4"});
  sleep_ms(1500);
  put("r.png", "theirs");
  const Answer answer = wait_for(pid);
  EXPECT_EQ(answer.status, 2) << answer.err;
  EXPECT_EQ(contents("r.png"), "theirs");
  EXPECT_FALSE(exists("r.png.partial"));
}

}  // namespace
}  // namespace command_line
