// Tests that interrupt a build by a signal and then resume it.
#include <signal.h>
#include <time.h>

#include <csignal>
#include <filesystem>

#include "core/base/clock.h"
#include "tests/cli/command_line.h"
#include "tests/support/image_files.h"

namespace command_line {
namespace {

class Interrupt : public CommandLine {
 protected:
  void SetUp() override {
    ASSERT_EQ(run({"generate", "soup", "s.glb", "--triangles", "3000"}).status, 0);
  }
  // Starts the build. Sends the signal `wait_ms` milliseconds after the build has printed its first
  // message, and waits for its end.
  Answer interrupt(int signal, int wait_ms) {
    put(".stderr", "");
    const pid_t pid = start(args_);
    for (int i = 0; i < 3000 && contents(".stderr").empty(); ++i) sleep_ms(1);
    sleep_ms(wait_ms);
    kill(pid, signal);
    return wait_for(pid);
  }
  // Starts `voxdag ARGS...` and sends the signal once is_ready() is true. If the program ends
  // without an error before the signal, removes `output` and tries again, up to ten times. Returns
  // the result of the last run.
  template <class IsReady>
  Answer interrupt_when(const IsReady& is_ready, int signal, const std::string& output,
                        const std::vector<std::string>& args) {
    Answer answer;
    for (int attempt = 0; attempt < 10; ++attempt) {
      put(".stderr", "");
      const pid_t pid = start(args);
      for (int i = 0; i < 30000 && !is_ready(); ++i) sleep_ms(1);
      signal_s_ = voxdag::wall_seconds();
      kill(pid, signal);
      answer = wait_for(pid);
      if (answer.status != 0) break;
      std::filesystem::remove(folder_.file(output));
    }
    return answer;
  }
  static void sleep_ms(int ms) {
    const timespec t{ms / 1000, ms % 1000 * 1000000};
    nanosleep(&t, nullptr);
  }
  const std::vector<std::string> args_ = {"build",  "s.glb",     "-r", "2048",        "-o",
                                          "s.vdag", "--threads", "1",  "--subvolume", "128"};
  double signal_s_ = 0;  // time of the last signal of interrupt_when(), in wall_seconds()
};

// A build that SIGINT or SIGTERM interrupts exits with status 130 and leaves no output file. The
// same command then resumes it, and writes the bytes of an uninterrupted build. A build can finish
// before its signal arrives, but at least one build must be interrupted.
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

// A JPEG of many scans takes long to decode. SIGTERM ends the build within 5 s nevertheless.
// tests/long/signals.py sends signals at random moments of every command.
TEST_F(Interrupt, InsideAnImageDecoder) {
  constexpr uint32_t kEdge = 2048;
  put("late.jpg", voxdag::test::jpeg_of_scans(kEdge, kEdge,
                                              std::string(size_t{3} * kEdge * kEdge, '\x60'), 400));
  put("late.gltf", R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":60,"uri":
    "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/"}],
    "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                 {"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
    "images":[{"uri":"late.jpg"}],"textures":[{"source":0}],
    "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}],
    "nodes":[{"mesh":0}]})");
  const auto decodes = [&] {  // the images are decoded after the stage `surfaces`
    if (contents(".stderr").find("surfaces") == std::string::npos) return false;
    sleep_ms(20);
    return true;
  };
  const Answer answer = interrupt_when(
      decodes, SIGTERM, "late.vdag",
      {"build", "late.gltf", "-r", "16", "-o", "late.vdag", "--color", "--memory", "1GiB"});
  EXPECT_EQ(answer.status, 130) << answer.err;
  EXPECT_LT(voxdag::wall_seconds() - signal_s_, 5);
}

// Stops extracts and exports after they have created their first file. A run can finish before its
// signal arrives, but at least one run must be interrupted.
class InterruptExport : public Interrupt {
 protected:
  void SetUp() override {
    Interrupt::SetUp();
    ASSERT_EQ(run({"build", "s.glb", "-r", "1024", "-o", "s.vdag"}).status, 0);
    std::signal(SIGHUP, SIG_DFL);  // the program that runs the tests can ignore SIGHUP
  }
  // Sends the signal once the file `first` exists.
  Answer interrupt_at(const std::string& first, int signal, const std::vector<std::string>& args) {
    return interrupt_when([&] { return exists(first); }, signal, "out", args);
  }
  size_t outputs() const {
    size_t count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
      count += entry.path().filename().string().starts_with("out");
    return count;
  }
};

TEST_F(InterruptExport, LeavesNothing) {
  const std::vector<std::string> extract = {"extract", "s.vdag", "-o", "out", "--threads", "1"};
  const std::vector<std::string> bt = {"export", "s.vdag", "--to", "bt", "-o", "out"};
  const std::vector<std::string> ply = {"export", "s.vdag", "--to", "ply", "-o", "out"};
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGKILL})
    for (const auto& args : {extract, bt, ply}) {
      SCOPED_TRACE(testing::Message()
                   << "signal " << signal << " to " << args[0] << " " << args[3]);
      const Answer answer =
          interrupt_at(args[0] == "extract" ? "out.lock" : "out.partial", signal, args);
      ASSERT_EQ(answer.status, signal == SIGKILL ? 128 + SIGKILL : 130) << answer.err;
      if (signal != SIGKILL) {
        EXPECT_EQ(outputs(), 0u);
      } else {
        EXPECT_GT(outputs(), 0u);
        // The same command must then succeed, and remove the temporary files of the killed run.
        const Answer again = run(args);
        EXPECT_EQ(again.status, 0) << again.err;
        EXPECT_EQ(outputs(), 1u);
        std::filesystem::remove(folder_.file("out"));
      }
    }
}

}  // namespace
}  // namespace command_line
