// Builds a small scene, simulates every fault of the disk and of the process, and checks that the
// build resumes with the expected bytes.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "core/format/global/voxdag_reader.h"
#include "core/format/verify/verify.h"
#include "scene/generate/generate.h"
#include "scheduler/run_build.h"
#include "tests/support/faulty_files.h"
#include "tests/support/temporary_folder.h"

namespace crash {

using voxdag::BuildReport;
using voxdag::BuildSpec;

// Stores the last warning. A resumed build must not warn, because none of its stored data is
// damaged.
class Warnings : public voxdag::NoProgress {
 public:
  void warn(std::string_view message) override { last = message; }
  std::string last;
};

// The number of moments at which each fault is tested. VOXDAG_CRASH_ROUNDS sets it; the default is
// 6.
inline uint64_t rounds() {
  const char* text = std::getenv("VOXDAG_CRASH_ROUNDS");
  return text ? std::strtoull(text, nullptr, 10) : 6;
}

// Where the triangles of the scene are stored between ingest and the build stage.
enum class Ingested { kInMemory, kDurable };

class CrashTest : public testing::TestWithParam<Ingested> {
 protected:
  void SetUp() override {
    voxdag::GenerateOptions options;
    options.kind = voxdag::SceneKind::kCity;
    // Checkpoints during ingest occur only with several batches of triangles.
    options.triangles = is_durable() ? 20000 : 3000;
    voxdag::NoProgress progress;
    voxdag::CancelToken cancel;
    voxdag::generate_scene(voxdag::system_files(), folder_.file("scene.glb"), options, progress,
                           cancel);
    expected_ = run(voxdag::system_files()).sha256;
    std::filesystem::remove(output());
  }
  static bool is_durable() { return GetParam() == Ingested::kDurable; }
  std::string output() const { return folder_.file("out.vdag"); }

  // The budget is small and there are several threads, so that the build spills triangles, splits
  // subvolumes and needs several merge passes.
  virtual BuildSpec spec() const {
    BuildSpec spec;
    spec.geometry.scenes = {folder_.file("scene.glb")};
    spec.geometry.resolution = 512;
    spec.run.output = output();
    spec.run.memory_bytes = uint64_t{64} << 20;
    spec.run.threads = 2;
    spec.run.subvolume_edge = 128;
    spec.run.checkpoint_interval_s =
        0;  // saves after every batch of triangles and every merged level
    if (is_durable()) spec.run.durable_min_triangles = 1;
    return spec;
  }
  static BuildReport build(const BuildSpec& spec, voxdag::FileSystem& files) {
    Warnings warnings;
    voxdag::CancelToken cancel;
    return voxdag::run_build(spec, {files, warnings, cancel});
  }
  BuildReport run(voxdag::FileSystem& files) const {
    Warnings warnings;
    voxdag::CancelToken cancel;
    const BuildReport report = voxdag::run_build(spec(), {files, warnings, cancel});
    // If an artifact had been recorded before it was durable, the resumed build would find it
    // damaged, would warn, and would build it again.
    EXPECT_EQ(warnings.last, "");
    return report;
  }

  // Builds in a separate process. Returns true if the process was killed before its end.
  bool killed(FaultPlan plan, std::chrono::microseconds after = {}) const {
    const pid_t child = fork();
    if (child == 0) {
      FaultyFiles files(plan);
      try {
        run(files);
      } catch (...) {
        _exit(1);
      }
      std::fflush(stdout);  // prints the failed EXPECTs of the child
      _exit(HasFailure() ? 1 : 0);
    }
    if (after.count() > 0) {
      std::this_thread::sleep_for(after);
      kill(child, SIGKILL);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0) << "the build failed by itself";
    return WIFSIGNALED(status);
  }

  // Runs the build again after a fault. Checks that it ends with the expected file and that no
  // other files remain.
  void expect_to_resume() {
    if (std::filesystem::exists(output())) {
      // A file of this name must always be complete.
      const voxdag_reader::File file(output());
      voxdag::MemoryBudget budget(uint64_t{1} << 30);
      voxdag::NoProgress progress;
      EXPECT_NO_THROW(voxdag::verify_global_file(file, 2, budget, progress, voxdag::CancelToken{}));
    }
    EXPECT_EQ(run(voxdag::system_files()).sha256, expected_);
    EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
    std::filesystem::remove(output());
  }

  // Returns numbers from 1 to `count`: all of them, or a random choice of rounds() numbers.
  static std::vector<uint64_t> moments(uint64_t count) {
    std::vector<uint64_t> all(count);
    for (uint64_t i = 0; i < count; ++i) all[i] = i + 1;
    if (all.size() > rounds()) {
      std::shuffle(all.begin(), all.end(), std::mt19937_64(rounds()));
      all.resize(rounds());
      all.front() = count;  // always includes the last moment
    }
    return all;
  }
  uint64_t operations_of_a_build() {
    FaultyFiles counting({});
    run(counting);
    std::filesystem::remove(output());
    return counting.operations();
  }

  // The process is killed before or after each write, sync, rename and removal, or the power fails
  // there.
  void kill_at_any_operation() {
    const uint64_t operations = operations_of_a_build();
    ASSERT_GT(operations, 15u);
    for (const Fault fault : {Fault::kKillBefore, Fault::kKillAfter, Fault::kPowerCut}) {
      uint64_t kills = 0;
      for (const uint64_t at : moments(operations)) {
        SCOPED_TRACE(testing::Message() << "fault " << static_cast<int>(fault) << " at operation "
                                        << at << " of " << operations);
        kills += killed({fault, at});
        expect_to_resume();
      }
      EXPECT_GT(kills, 0u);
    }
  }

  // The disk becomes full, or fails, at any operation. The build reports the error. When the disk
  // works again, the build resumes without loss.
  void break_disk_at_any_operation() {
    const uint64_t operations = operations_of_a_build();
    struct Case {
      Fault fault;
      voxdag::ErrorCode code;
    };
    for (const Case& c : {Case{Fault::kNoSpace, voxdag::ErrorCode::kNoSpace},
                          Case{Fault::kIoError, voxdag::ErrorCode::kIo}}) {
      for (const uint64_t at : moments(operations)) {
        SCOPED_TRACE(testing::Message() << "fault " << static_cast<int>(c.fault)
                                        << " from operation " << at << " of " << operations);
        FaultyFiles files({c.fault, at});
        try {
          run(files);
          // A build succeeds only if the fault affected nothing but the removal of leftover files.
          EXPECT_TRUE(std::filesystem::exists(output()));
          std::filesystem::remove_all(output() + ".work");
        } catch (const voxdag::Error& error) {
          EXPECT_EQ(error.code(), c.code) << error.what();
        }
        expect_to_resume();
      }
    }
  }

  voxdag::TemporaryFolder folder_;
  std::string expected_;
};

inline std::string name_of(const testing::TestParamInfo<Ingested>& info) {
  return info.param == Ingested::kDurable ? "Durable" : "InMemory";
}

}  // namespace crash
