// Complete builds with --backend cuda on the simulated device, which all workers of the scheduler
// share. The file must equal the CPU backend's file, byte for byte, also after kills and failures.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "core/backend/backend.h"
#include "core/fields/field.h"
#include "scene/generate/generate.h"
#include "scheduler/run_build.h"
#include "tests/cuda_sim/sim/faults.h"
#include "tests/cuda_sim/sim/schedule.h"
#include "tests/support/faulty_files.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

class SimulatedBuild : public testing::Test {
 protected:
  void SetUp() override {
    // Because these functions are called here, the linker takes the complete backend from the
    // simulation.
    ASSERT_EQ(cuda_device_count(), 1);
    ASSERT_EQ(make_cuda_backend()->name(), "cuda");
    GenerateOptions options;
    options.kind = SceneKind::kCity;
    options.triangles = 400;
    NoProgress progress;
    generate_scene(system_files(), folder_.file("scene.glb"), options, progress, CancelToken{});
    expected_ = run(spec(BackendName::kCpu, MethodName::kDefault), system_files()).sha256;
    std::filesystem::remove(output());
  }

  std::string output() const { return folder_.file("out.vdag"); }

  BuildSpec spec(BackendName backend, MethodName method) const {
    BuildSpec spec;
    spec.geometry.scenes = {folder_.file("scene.glb")};
    spec.geometry.resolution = 256;
    spec.run.output = output();
    spec.run.memory_bytes = uint64_t{64} << 20;
    spec.run.threads = 2;
    spec.run.subvolume_edge = 64;
    spec.run.checkpoint_interval_s = 0;
    spec.run.backend = backend;
    spec.run.method = method;
    return spec;
  }

  static BuildReport run(const BuildSpec& spec, FileSystem& files) {
    NoProgress progress;
    return run_build(spec, {files, progress, CancelToken{}});
  }

  TemporaryFolder folder_;
  std::string expected_;
};

TEST_F(SimulatedBuild, HasTheBytesOfTheCpuBackend) {
  uint64_t seed = 1;
  for (const MethodName method :
       {MethodName::kDefault, MethodName::kHashes, MethodName::kPointers}) {
    cuda_sim::set_schedule({seed % 2 == 0, seed});
    ++seed;
    const BuildReport report = run(spec(BackendName::kCuda, method), system_files());
    EXPECT_EQ(report.sha256, expected_) << name_of(method);
    EXPECT_EQ(report.backend, "cuda");
    EXPECT_EQ(cuda_sim::bytes_in_use(), 0u);
    std::filesystem::remove(output());
  }
}

// A build is killed at some of its disk operations, and resumed on the device or on the CPU. The
// resumed build writes the expected bytes.
TEST_F(SimulatedBuild, ResumesAfterAKill) {
  crash::FaultyFiles counting({});
  run(spec(BackendName::kCuda, MethodName::kDefault), counting);
  std::filesystem::remove(output());
  int kills = 0;
  for (uint64_t part = 1; part <= 6; ++part) {
    const uint64_t at = counting.operations() * part / 7;
    SCOPED_TRACE(testing::Message() << "at operation " << at << " of " << counting.operations());
    const pid_t child = fork();
    if (child == 0) {
      crash::FaultyFiles files({crash::Fault::kKillAfter, at});
      try {
        run(spec(BackendName::kCuda, MethodName::kDefault), files);
      } catch (...) {
        _exit(1);
      }
      _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    kills += WIFSIGNALED(status) ? 1 : 0;
    EXPECT_EQ(run(spec(part % 2 ? BackendName::kCuda : BackendName::kCpu, MethodName::kDefault),
                  system_files())
                  .sha256,
              expected_);
    std::filesystem::remove(output());
  }
  EXPECT_GT(kills, 0);
}

// If the device fails during the build, the build ends with an error that names the device. The
// next build reuses the stored subvolumes.
TEST_F(SimulatedBuild, SaysThatTheDeviceFailed) {
  cuda_sim::plan_fault({cuda_sim::Call::kOther, 2000, cudaErrorLaunchFailure, true});
  try {
    run(spec(BackendName::kCuda, MethodName::kDefault), system_files());
    FAIL() << "the device failed, and the build did not";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kDevice) << error.what();
    EXPECT_NE(std::string(error.what()).find("CUDA device 0"), std::string::npos) << error.what();
  }
  EXPECT_TRUE(cuda_sim::fault_happened());
  cuda_sim::plan_no_fault();
  const BuildReport report = run(spec(BackendName::kCpu, MethodName::kDefault), system_files());
  EXPECT_EQ(report.sha256, expected_);
  EXPECT_GT(report.subvolumes_reused, 0u);
}

}  // namespace
}  // namespace voxdag
