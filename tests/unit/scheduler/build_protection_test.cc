// Regression tests for defects that were found by attacking builds: with hostile files and folders,
// full disks, and concurrent builds.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <thread>

#include "core/base/error.h"
#include "scheduler/plan_build.h"
#include "scheduler/run_build.h"
#include "scheduler/state/build_locks.h"
#include "scheduler/state/job_store.h"
#include "scheduler/state/work_folder.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/interruptions.h"
#include "tests/unit/scheduler/metered_files.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag {
namespace {

class WarningTexts : public NoProgress {
 public:
  void warn(std::string_view message) override {
    text += std::string(message) + "\n";
    if (on_warning) on_warning();
  }
  std::string text;
  std::function<void()> on_warning;
};

class BuildProtection : public testing::Test {
 protected:
  void SetUp() override { write_spheres(scene(), 20000); }
  std::string scene() const { return folder_.file("scene.glb"); }
  std::string output() const { return folder_.file("out.vdag"); }
  BuildSpec spec() const { return spheres_build(scene(), output()); }
  BuildContext context() { return {files_, warnings_, cancel_}; }

  const TemporaryFolder folder_;
  MeteredFiles files_;
  WarningTexts warnings_;
  CancelToken cancel_;
};

// A killed build holds its locks until the system has removed its process. The next build waits for
// the lock of the output or of the work folder, and reports that it waits.
TEST_F(BuildProtection, WaitsForTheLocksOfADyingBuild) {
  for (const std::string& path : {OutputLock::path_of(output()), output() + ".work/lock"}) {
    SCOPED_TRACE(path);
    std::filesystem::create_directories(output() + ".work");
    auto held = system_files().try_lock(path);
    ASSERT_TRUE(held);
    warnings_.text.clear();
    warnings_.on_warning = [&] { held.reset(); };
    const BuildReport report = run_build(spec(), context());
    EXPECT_EQ(report.sha256.size(), 64u);
    EXPECT_NE(warnings_.text.find("is in use by another build: waiting up to 30 s"),
              std::string::npos)
        << warnings_.text;
    EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
  }
}

// While a build waits for the lock of its output, the other build can write the output. Then the
// waiting build treats it like an output that existed when it started: it replaces a result of the
// same scene, and keeps a result of another scene.
TEST_F(BuildProtection, AnOutputWrittenDuringTheWaitIsCheckedAgain) {
  const std::string other_scene = folder_.file("other.glb");
  write_spheres(other_scene, 5000);
  for (const bool keep_work : {false, true})
    for (const bool is_same : {true, false}) {
      SCOPED_TRACE(testing::Message() << "keep_work " << keep_work << ", same scene " << is_same);
      BuildSpec waiting = spec();
      waiting.run.keep_work = keep_work;
      const BuildSpec other =
          spheres_build(is_same ? scene() : other_scene, folder_.file("first.vdag"));
      const std::string sha256 = run_build(other, context()).sha256;
      for (const char* suffix : {"", ".report.json", ".work"})
        std::filesystem::remove_all(output() + suffix);
      auto held = system_files().try_lock(OutputLock::path_of(output()));
      ASSERT_TRUE(held);
      warnings_.on_warning = [&] {
        for (const char* suffix : {"", ".report.json"})
          std::filesystem::copy_file(other.run.output + suffix, output() + suffix);
        held.reset();
      };
      if (is_same) {
        EXPECT_EQ(run_build(waiting, context()).sha256, sha256);
      } else {
        const Error error = error_of([&] { run_build(waiting, context()); });
        EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
        EXPECT_NE(error.message().find("is the result of another scene"), std::string::npos)
            << error.message();
        EXPECT_EQ(std::filesystem::file_size(output()),
                  std::filesystem::file_size(other.run.output));
      }
      warnings_.on_warning = nullptr;
      EXPECT_EQ(std::filesystem::exists(output() + ".work"), keep_work && is_same);
    }
}

// The other build can also have been killed while it wrote.
TEST_F(BuildProtection, APartialFileWrittenDuringTheWaitIsReplaced) {
  const std::string partial = output() + ".partial";
  auto held = system_files().try_lock(OutputLock::path_of(output()));
  ASSERT_TRUE(held);
  warnings_.on_warning = [&] {
    std::ofstream(partial) << std::string(10000, '\0');
    held.reset();
  };
  EXPECT_EQ(run_build(spec(), context()).sha256.size(), 64u);
  EXPECT_FALSE(std::filesystem::exists(partial));
}

// If a lock is not released in time, the build fails with kIo, a transient error, so that the
// service tries the job again.
TEST_F(BuildProtection, ALockThatStaysIsATransientError) {
  BuildSpec impatient = spec();
  impatient.run.lock_wait_s = 0.1;
  const OutputLock output_lock(files_, output());
  const Error by_output = error_of([&] { run_build(impatient, context()); });
  EXPECT_EQ(by_output.code(), ErrorCode::kIo);
  EXPECT_NE(by_output.message().find("is being written by another process"), std::string::npos);
  impatient.run.output = folder_.file("other.vdag");
  const WorkFolder work(context(), folder_.file("other.vdag.work"), 0);
  const Error by_folder = error_of([&] { run_build(impatient, context()); });
  EXPECT_EQ(by_folder.code(), ErrorCode::kIo);
  EXPECT_NE(by_folder.message().find("is in use by process"), std::string::npos);
}

// A build that waits for a lock can be canceled.
TEST_F(BuildProtection, WaitingCanBeCanceled) {
  const OutputLock output_lock(files_, output());
  std::thread user([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    cancel_.cancel();
  });
  const Error error = error_of([&] { run_build(spec(), context()); });
  user.join();
  EXPECT_EQ(error.code(), ErrorCode::kCanceled);
}

// A few bytes can describe billions of triangles. If neither memory nor disk can hold the
// triangles, `build` and `plan` refuse the scene before they read it.
TEST_F(BuildProtection, TrianglesThatFitNowhereAreRefusedBeforeTheyAreRead) {
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

// A build stops with kNoSpace before less than min_free_bytes of the disk are free. It can be
// resumed when more space is free.
TEST_F(BuildProtection, TheReserveStopsABuildThatResumes) {
  BuildSpec reserved = spec();
  reserved.run.force = true;
  const uint64_t free_bytes = files_.free_space(folder_.path());
  reserved.run.min_free_bytes = free_bytes + (uint64_t{1} << 30);
  const Error error = error_of([&] {
    write_spheres(scene(), 700000);
    run_build(reserved, context());
  });
  EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
  EXPECT_NE(error.message().find("must stay free"), std::string::npos) << error.message();
  EXPECT_FALSE(std::filesystem::exists(output()));
  reserved.run.min_free_bytes = 0;
  EXPECT_NO_THROW(run_build(reserved, context()));
}

// At any resolution, a build is refused if its estimated disk space exceeds the free space. The
// reserve, min_free_bytes, does not count as free.
TEST_F(BuildProtection, SmallBuildsAreRefusedByTheEstimateToo) {
  files_.free_bytes = 1'000'000'000;
  BuildSpec small = spec();
  EXPECT_NO_THROW(run_build(small, context()));
  small.run.restart = true;
  small.run.min_free_bytes = files_.free_bytes - 1000;
  const Error error = error_of([&] { run_build(small, context()); });
  EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
  EXPECT_NE(error.message().find("the build is estimated"), std::string::npos) << error.message();
  EXPECT_NE(error.message().find(" has 1000 B free"), std::string::npos) << error.message();
  EXPECT_EQ(plan_build(small, context()).free_disk, 1000u);
}

// If two folders have the same device, they are on one disk, and the build compares the sum of
// their estimated disk space with the free space of this disk. Otherwise it compares the estimate
// of each folder with the free space of its disk.
TEST_F(BuildProtection, DisksAreToldApartByTheirDevice) {
  BuildSpec large = spec();
  large.geometry.resolution = 4096;
  files_.free_bytes = 100'000;
  const auto refusal = [&] { return error_of([&] { run_build(large, context()); }).message(); };
  EXPECT_NE(refusal().find("the build is estimated"), std::string::npos) << refusal();
  files_.other_disk = output() + ".work";
  EXPECT_NE(refusal().find("the build's work folder is"), std::string::npos) << refusal();
}

// While a build waits for the lock of its output, another build publishes the output. The lock file
// must keep its name during this, so that a third build also waits for it.
TEST_F(BuildProtection, ALockOfTheOutputHasAName) {
  auto first = std::make_unique<OutputLock>(files_, output());
  std::unique_ptr<OutputLock> second;
  std::thread waiting([&] { second.reset(new OutputLock(lock_output(context(), output(), 30))); });
  // A build renames the partial file at its end, and removes it if its merge restarts.
  for (int file = 0; file < 2; ++file) {
    std::ofstream(output() + ".partial") << "levels";
    if (file) std::filesystem::rename(output() + ".partial", output());
    std::filesystem::remove(output() + ".partial");
    EXPECT_EQ(system_files().try_lock(OutputLock::path_of(output())), nullptr);
  }
  first.reset();
  waiting.join();
  EXPECT_EQ(error_of([&] { OutputLock(files_, output()); }).code(), ErrorCode::kIo);
  second.reset();
  EXPECT_FALSE(std::filesystem::exists(OutputLock::path_of(output())));
}

// A build holds the lock of its output from its first stage until the output has its final name.
TEST_F(BuildProtection, ABuildHoldsItsOutputUntilItEnds) {
  // Checks at the beginning and the end of each stage that another build cannot get the lock.
  class Looking : public NoProgress {
   public:
    explicit Looking(const std::string& output) : path_(OutputLock::path_of(output)) {}
    void begin_stage(std::string_view, uint64_t, std::string_view) override { look(); }
    void end_stage() override { look(); }
    int looks = 0;

   private:
    void look() {
      ++looks;
      EXPECT_EQ(system_files().try_lock(path_), nullptr);
    }
    const std::string path_;
  } looking(output());
  const BuildReport report = run_build(spec(), {files_, looking, cancel_});
  EXPECT_GT(looking.looks, 6);  // includes the end of the stage that renames the output
  EXPECT_EQ(report.sha256.size(), 64u);
  EXPECT_FALSE(std::filesystem::exists(OutputLock::path_of(output())));
}

// A build keeps a file at the path of its lock file if another program created it.
TEST_F(BuildProtection, AForeignFileOfTheLocksNameStays) {
  std::ofstream(OutputLock::path_of(output())) << "mine";
  run_build(spec(), context());
  EXPECT_EQ(read_small_file(files_, OutputLock::path_of(output()), 10), "mine");
}

// A build refuses a work folder in which a symbolic link or a pipe has the name of one of its
// files. It does not write through the link.
TEST_F(BuildProtection, LinksInTheWorkFolderAreNotFollowed) {
  const std::string victim = folder_.file("victim.txt"), work = output() + ".work";
  std::ofstream(victim) << "precious";
  for (const char* name : {"lock", "triangles.vdspill", "segment-0.vdseg", "job.db", "merge"}) {
    SCOPED_TRACE(name);
    std::filesystem::create_directories(work);
    std::filesystem::create_symlink(victim, work + "/" + name);
    const Error by_build = error_of([&] { run_build(spec(), context()); });
    EXPECT_EQ(by_build.code(), ErrorCode::kInvalidInput) << by_build.message();
    BuildSpec planned = spec();
    planned.run.work_folder = work;
    EXPECT_EQ(error_of([&] { plan_build(planned, context()); }).code(), ErrorCode::kInvalidInput);
    EXPECT_EQ(read_small_file(files_, victim, 100), "precious");
    std::filesystem::remove_all(work);
  }
  std::filesystem::create_directories(work);
  ASSERT_EQ(mkfifo((work + "/lock").c_str(), 0600), 0);
  EXPECT_EQ(error_of([&] { run_build(spec(), context()); }).code(), ErrorCode::kInvalidInput);
}

// A plan creates a new temporary folder that only its user can read. It does not use a folder with
// a similar name, because another user could have prepared it.
TEST_F(BuildProtection, APlanTakesAFolderOfItsOwn) {
  const std::string temporary = folder_.file("tmp"), victim = folder_.file("victim.txt");
  const std::string foreseen = temporary + "/voxdag-plan-" + std::to_string(getpid());
  std::filesystem::create_directories(foreseen);
  std::ofstream(victim) << "precious";
  std::filesystem::create_symlink(victim, foreseen + "/lock");
  const char* before = std::getenv("TMPDIR");
  const std::string restored = before ? before : "";
  setenv("TMPDIR", temporary.c_str(), 1);
  class Looking : public NoProgress {
   public:
    explicit Looking(std::string folder) : folder_(std::move(folder)) {}
    void begin_stage(std::string_view, uint64_t, std::string_view) override {
      for (const auto& entry : std::filesystem::directory_iterator(folder_))
        if (std::filesystem::exists(entry.path() / "lock") &&
            !std::filesystem::is_symlink(entry.path() / "lock"))
          others_may |= (entry.status().permissions() & std::filesystem::perms(077)) !=
                        std::filesystem::perms::none;
        else
          ++foreign;
    }
    bool others_may = false;
    int foreign = 0;

   private:
    const std::string folder_;
  } looking(temporary);
  EXPECT_NO_THROW(plan_build(spec(), {files_, looking, cancel_}));
  before ? setenv("TMPDIR", restored.c_str(), 1) : unsetenv("TMPDIR");
  EXPECT_FALSE(looking.others_may);
  EXPECT_GT(looking.foreign, 0);
  EXPECT_EQ(read_small_file(files_, victim, 100), "precious");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(temporary), {}), 1);
}

// If rows of subvolumes are missing in the job store, the build fails, because its file would lack
// their voxels. With --restart it starts over.
TEST_F(BuildProtection, ABuildNoticesMissingRows) {
  const std::string expected = run_build(spec(), context()).sha256;
  std::filesystem::remove(output());
  build_until(spec(), "build", 40);
  SqlDatabase(output() + ".work/job.db", SqlDatabase::Mode::kReadWrite)
      .execute("PRAGMA foreign_keys = OFF; DELETE FROM subvolume WHERE id % 2 = 0");
  EXPECT_EQ(error_of([&] { run_build(spec(), context()); }).code(), ErrorCode::kCorrupt);
  BuildSpec again = spec();
  again.run.restart = true;
  EXPECT_EQ(run_build(again, context()).sha256, expected);
}

// A build refuses a damaged row of the job. With --restart it starts over.
TEST_F(BuildProtection, ADamagedJobStartsOver) {
  build_until(spec(), "build", 5);
  SqlDatabase(output() + ".work/job.db", SqlDatabase::Mode::kReadWrite)
      .execute("UPDATE job SET subvolumes = subvolumes + 1");
  EXPECT_EQ(error_of([&] { run_build(spec(), context()); }).code(), ErrorCode::kCorrupt);
  BuildSpec again = spec();
  again.run.restart = true;
  EXPECT_EQ(run_build(again, context()).subvolumes_reused, 0u);
}

// If a file of the scene has a path at which the build would write its own files, the build refuses
// the scene and keeps the file.
TEST_F(BuildProtection, ABuildDoesNotDestroyItsScene) {
  BuildSpec inside = spec();
  inside.run.work_folder = folder_.file("w");
  for (const char* name : {"segment-5.vdseg", "triangles.vdspill", "merge/merge-1"}) {
    SCOPED_TRACE(name);
    const std::string path = inside.run.work_folder + "/" + name;
    std::filesystem::create_directories(inside.run.work_folder + "/merge");
    std::filesystem::copy_file(scene(), path);
    inside.geometry.scenes = {path};
    EXPECT_EQ(error_of([&] { run_build(inside, context()); }).code(), ErrorCode::kInvalidInput);
    EXPECT_EQ(error_of([&] { plan_build(inside, context()); }).code(), ErrorCode::kInvalidInput);
    EXPECT_TRUE(std::filesystem::exists(path));
    std::filesystem::remove_all(inside.run.work_folder);
  }
  const std::string text = folder_.file("scene.gltf");
  for (const std::string name :
       {"out.vdag.partial", "out.vdag.lock", "w/segment-5.vdseg", "w/triangles.vdspill"}) {
    SCOPED_TRACE(name);
    std::filesystem::create_directories(inside.run.work_folder);
    std::ofstream(text) << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
      "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
      "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
        "min":[0,0,0],"max":[0,0,0]}],
      "bufferViews":[{"buffer":0,"byteLength":36}],
      "buffers":[{"byteLength":36,"uri":")"
                        << name << R"("}]})";
    std::ofstream(folder_.file(name)) << std::string(36, '\0');
    inside.geometry.scenes = {text};
    const Error error = error_of([&] { run_build(inside, context()); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("is an input and would be"), std::string::npos)
        << error.message();
    EXPECT_EQ(std::filesystem::file_size(folder_.file(name)), 36u);
    std::filesystem::remove(folder_.file(name));
  }
}

// Invalid options are refused before any file is read or written.
TEST_F(BuildProtection, OptionsAreCheckedFirst) {
  BuildSpec wrong = spec();
  wrong.geometry.voxel_size = 0;
  EXPECT_EQ(error_of([&] { run_build(wrong, context()); }).code(), ErrorCode::kInvalidInput);
  EXPECT_EQ(files_.bytes_read[scene()], 0u);
  wrong = spec();
  wrong.run.cache_folder = folder_.path() + "/./x/";
  wrong.run.work_folder = folder_.file("x");
  EXPECT_NE(error_of([&] { run_build(wrong, context()); }).message().find("two folders"),
            std::string::npos);
  for (std::string RunOptions::*folder : {&RunOptions::work_folder, &RunOptions::cache_folder}) {
    wrong = spec();
    wrong.run.*folder = scene();
    const Error error = error_of([&] { run_build(wrong, context()); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("expected a folder"), std::string::npos) << error.message();
    EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
  }
}

}  // namespace
}  // namespace voxdag
