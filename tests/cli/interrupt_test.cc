// Tests that interrupt a build by a signal and then resume it.
#include <signal.h>
#include <time.h>

#include <filesystem>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class Interrupt : public CommandLine {
 protected:
  void SetUp() override {
    ASSERT_EQ(run({"generate", "soup", "s.glb", "--triangles", "3000"}).status, 0);
  }
  // Runs the build until its first message plus wait_ms, then sends a signal.
  Answer interrupt(int signal, int wait_ms) {
    put(".stderr", "");
    const pid_t pid = start(args_);
    for (int i = 0; i < 3000 && contents(".stderr").empty(); ++i) sleep_ms(1);
    sleep_ms(wait_ms);
    kill(pid, signal);
    return wait_for(pid);
  }
  static void sleep_ms(int ms) {
    const timespec t{ms / 1000, ms % 1000 * 1000000};
    nanosleep(&t, nullptr);
  }
  const std::vector<std::string> args_ = {"build",  "s.glb",     "-r", "2048",        "-o",
                                          "s.vdag", "--threads", "1",  "--subvolume", "128"};
};

// Either signal stops a build with status 130 and nothing under the final name; the same command
// then writes the bytes of an uninterrupted build. A build may finish before its signal arrives,
// but at least one of them must be interrupted.
TEST_F(Interrupt, StopsAndResumes) {
  std::vector<std::string> clean = args_;
  clean[5] = "clean.vdag";
  ASSERT_EQ(run(clean).status, 0);
  for (const int signal : {SIGINT, SIGTERM}) {
    int caught = 0;
    for (const int wait_ms : {0, 10, 50, 200}) {
      SCOPED_TRACE(testing::Message() << "signal " << signal << " after " << wait_ms << " ms");
      const Answer answer = interrupt(signal, wait_ms);
      if (answer.status != 0) {
        ASSERT_EQ(answer.status, 130) << answer.err;
        EXPECT_NE(answer.err.find("canceled"), std::string::npos) << answer.err;
        EXPECT_FALSE(exists("s.vdag"));
        EXPECT_FALSE(exists("s.vdag.report.json"));
        ++caught;
        ASSERT_EQ(run(args_).status, 0);
      }
      EXPECT_TRUE(contents("s.vdag") == contents("clean.vdag"));
      EXPECT_FALSE(exists("s.vdag.work"));
      for (const char* name : {"s.vdag", "s.vdag.report.json"})
        std::filesystem::remove(folder_.file(name));
    }
    EXPECT_GT(caught, 0);
  }
}

}  // namespace
}  // namespace command_line
