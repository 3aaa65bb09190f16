#include "scheduler/stages/build/choose_backend.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/error.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag {
namespace {

constexpr uint64_t kPlenty = uint64_t{16} << 30;

class BackendWarnings : public NoProgress {
 public:
  void warn(std::string_view message) override { all.emplace_back(message); }
  std::vector<std::string> all;
};

// A defective backend: like the CPU backend, but omits the lowest voxel of the last brick with more
// than one voxel.
class Forgetful : public Backend {
 public:
  std::string_view name() const override { return "forgetful"; }
  BuildOutcome build(const SubvolumeTask& task, TriangleStream& triangles, MemoryBudget& budget,
                     const CancelToken& cancel, SubDagSink& sink, SubDagSummary& summary) override {
    SubDag dag;
    const BuildOutcome outcome = cpu_->build(task, triangles, budget, cancel, dag, summary);
    for (uint64_t& mask : dag.brick_masks)
      if (const uint64_t fewer = mask & (mask - 1)) {
        mask = fewer;
        break;
      }
    if (!dag.brick_masks.empty()) sink.bricks({dag.brick_masks});
    for (const SubDag::Nodes& level : dag.levels) sink.nodes(level.view());
    return outcome;
  }

 private:
  const std::unique_ptr<Backend> cpu_ = make_cpu_backend();
};

std::unique_ptr<Backend> right_gpu(int) { return make_parallel_host_backend(Method::kFast); }

// difference_from_cpu() accepts every correct backend, and detects a backend that omits a single
// voxel.
TEST(BackendCheck, FindsOneVoxel) {
  for (const Method method : {Method::kFast, Method::kPointers, Method::kHashes})
    EXPECT_EQ(difference_from_cpu(*make_parallel_host_backend(method)), "");
  Forgetful forgetful;
  EXPECT_NE(difference_from_cpu(forgetful), "");
}

// Without a GPU, the CPU is chosen and no warning is printed. If GPUs pass the check, they are
// chosen, and the workers are distributed among them.
TEST(ChooseBackend, AutoChoosesGpusThatAreRight) {
  BackendWarnings warnings;
  EXPECT_EQ(choose_automatically({}, kPlenty, warnings).name, "cpu");
  std::vector<int> opened;
  const Gpus gpus{3, [&](int device) {
                    opened.push_back(device);
                    return right_gpu(device);
                  }};
  const BackendChoice choice = choose_automatically(gpus, kPlenty, warnings);
  EXPECT_EQ(choice.name, "cuda");
  EXPECT_GE(choice.max_workers, 6u);
  EXPECT_EQ(opened, (std::vector<int>{0, 1, 2}));  // each was checked
  opened.clear();
  for (int i = 0; i < 5; ++i) choice.open();
  EXPECT_EQ(opened, (std::vector<int>{0, 1, 2, 0, 1}));
  EXPECT_TRUE(warnings.all.empty());
}

// If a GPU gives wrong results, cannot be opened or has too little memory, the build uses the CPU
// and prints one warning with the reason.
TEST(ChooseBackend, AutoFallsBackToTheCpu) {
  const auto expect_cpu = [](const Gpus& gpus, uint64_t memory_bytes, const std::string& why) {
    SCOPED_TRACE(why);
    BackendWarnings warnings;
    EXPECT_EQ(choose_automatically(gpus, memory_bytes, warnings).name, "cpu");
    ASSERT_EQ(warnings.all.size(), 1u);
    EXPECT_NE(warnings.all[0].find(why), std::string::npos) << warnings.all[0];
  };
  expect_cpu({1, right_gpu}, uint64_t{64} << 20, "--memory");
  const auto second_wrong = [](int device) -> std::unique_ptr<Backend> {
    if (device == 0) return right_gpu(0);
    return std::make_unique<Forgetful>();
  };
  expect_cpu({2, second_wrong}, kPlenty, "GPU 1");
  const auto broken = [](int) -> std::unique_ptr<Backend> {
    throw Error(ErrorCode::kDevice, "cudaStreamCreate failed");
  };
  expect_cpu({1, broken}, kPlenty, "cudaStreamCreate failed");
}

// Refuses unknown names of backends and methods, and a method that the chosen backend does not
// have.
TEST(ChooseBackend, RefusesWhatDoesNotGoTogether) {
  const auto refused = [](const std::string& backend, const std::string& method) {
    RunOptions options;
    if (!parse_text("backend", backend, options.backend)) return true;
    if (!method.empty() && !parse_text("method", method, options.method)) return true;
    try {
      check_backend(options, VoxelRule::kShell);
      return false;
    } catch (const Error& error) {
      return error.code() == ErrorCode::kInvalidInput;
    }
  };
  EXPECT_TRUE(refused("gpu", ""));
  EXPECT_TRUE(refused("cpu", "hashes"));
  EXPECT_TRUE(refused("auto", "pointers"));
  EXPECT_TRUE(refused("parallel-host", "consing"));
  EXPECT_FALSE(refused("auto", "consing"));
  EXPECT_FALSE(refused("parallel-host", "pointers"));
}

}  // namespace
}  // namespace voxdag
