// Regression tests of defects that attacks on builds found.
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "core/base/error.h"
#include "scheduler/job/build_locks.h"
#include "scheduler/job/work_folder.h"
#include "scheduler/plan/estimate.h"
#include "scheduler/run_build.h"
#include "tests/unit/base/error_of.h"
#include "tests/unit/io/temporary_folder.h"
#include "tests/unit/scheduler/metered_files.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag {
namespace {

class Warnings : public NoProgress {
 public:
  void warn(std::string_view message) override { text += std::string(message) + "\n"; }
  std::string text;
};

class Hardening : public testing::Test {
 protected:
  void SetUp() override { write_spheres(scene(), 20000); }
  std::string scene() const { return folder_.file("scene.glb"); }
  std::string output() const { return folder_.file("out.vdag"); }
  BuildSpec spec() const { return spheres_build(scene(), output()); }
  BuildContext context() { return {files_, warnings_, cancel_}; }

  const TemporaryFolder folder_;
  MeteredFiles files_;
  Warnings warnings_;
  CancelToken cancel_;
};

// A build that was killed holds its locks until the system has taken it apart. The next one waits
// for each of them, and says so.
TEST_F(Hardening, M5_WaitsForTheLocksOfADyingBuild) {
  for (const std::string& path : {output() + ".partial", output() + ".work/lock"}) {
    SCOPED_TRACE(path);
    std::filesystem::create_directories(output() + ".work");
    auto held = system_files().try_lock(path);
    ASSERT_TRUE(held);
    warnings_.text.clear();
    std::thread dying([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(800));
      held.reset();
    });
    const BuildReport report = run_build(spec(), context());
    dying.join();
    EXPECT_EQ(report.sha256.size(), 64u);
    EXPECT_NE(warnings_.text.find("is in use by another build: waiting up to 30 s"),
              std::string::npos)
        << warnings_.text;
    EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
  }
}

// A lock that stays is an error that a later try may not have: the service tries again.
TEST_F(Hardening, M5_ALockThatStaysIsATransientError) {
  BuildSpec impatient = spec();
  impatient.run.lock_wait_s = 0.1;
  const OutputLock output_lock(context(), output(), 0);
  const Error by_output = error_of([&] { run_build(impatient, context()); });
  EXPECT_EQ(by_output.code(), ErrorCode::kIo);
  EXPECT_NE(by_output.message().find("is being written by another build"), std::string::npos);
  impatient.run.output = folder_.file("other.vdag");
  const WorkFolder work(context(), folder_.file("other.vdag.work"), 0);
  const Error by_folder = error_of([&] { run_build(impatient, context()); });
  EXPECT_EQ(by_folder.code(), ErrorCode::kIo);
  EXPECT_NE(by_folder.message().find("is in use by process"), std::string::npos);
}

// Whoever waits for a lock can be stopped.
TEST_F(Hardening, M5_WaitingCanBeCanceled) {
  const OutputLock output_lock(context(), output(), 0);
  std::thread user([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    cancel_.cancel();
  });
  const Error error = error_of([&] { run_build(spec(), context()); });
  user.join();
  EXPECT_EQ(error.code(), ErrorCode::kCanceled);
}

// A few bytes can describe billions of triangles: what neither memory nor disk can hold is refused
// before it is read, by `plan` as well.
TEST_F(Hardening, L8_TrianglesThatFitNowhereAreRefusedBeforeTheyAreRead) {
  write_spheres(scene(), 700000);
  BuildSpec tight = spec();
  tight.run.memory_bytes = uint64_t{64} << 20;
  files_.free_bytes = 1'000'000;
  const Error error = error_of([&] { run_build(tight, context()); });
  EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
  EXPECT_NE(error.message().find("triangles, which take"), std::string::npos) << error.message();
  EXPECT_EQ(error.message().find("--force"), std::string::npos) << error.message();
  EXPECT_FALSE(files_.bytes_written.contains(output() + ".work/triangles.vdspill"));
  EXPECT_EQ(error_of([&] { plan_build(tight, context()); }).code(), ErrorCode::kNoSpace);
  tight.run.memory_bytes = uint64_t{512} << 20;
  EXPECT_NO_THROW(plan_build(tight, context()));
}

}  // namespace
}  // namespace voxdag
