#include "scheduler/spec/gpu_use.h"

#include <gtest/gtest.h>

namespace voxdag {
namespace {

// Large builds with few threads per GPU are faster on GPUs. Small builds are not, because CUDA
// takes time to start.
TEST(GpuUse, AutoComparesSpeeds) {
  EXPECT_FALSE(are_gpus_faster(1e12, 1, 0));
  EXPECT_FALSE(are_gpus_faster(1e6, 1, 1));
  EXPECT_FALSE(are_gpus_faster(1e6, 1, 8));
  EXPECT_TRUE(are_gpus_faster(1e9, 2, 1));
  EXPECT_FALSE(are_gpus_faster(1e9, 64, 1));
  EXPECT_TRUE(are_gpus_faster(1e9, 64, 16));
}

// `cuda` uses GPUs for builds of any size; `cpu`, `parallel-host` and a given method use none.
TEST(GpuUse, CountsTheGpusToUse) {
  RunOptions options;
  options.threads = 1;
  options.backend = BackendName::kCuda;
  EXPECT_EQ(gpus_to_use(options, VoxelRule::kShell, 1), cuda_device_count());
  options.backend = BackendName::kAuto;
  EXPECT_EQ(gpus_to_use(options, VoxelRule::kShell, 1), 0);
  EXPECT_EQ(gpus_to_use(options, VoxelRule::kShell, 1e12), cuda_device_count());
  options.method = MethodName::kConsing;
  EXPECT_EQ(gpus_to_use(options, VoxelRule::kShell, 1e12), 0);
  options.method = MethodName::kDefault;
  for (const BackendName backend : {BackendName::kCpu, BackendName::kParallelHost}) {
    options.backend = backend;
    EXPECT_EQ(gpus_to_use(options, VoxelRule::kShell, 1e12), 0);
  }
}

}  // namespace
}  // namespace voxdag
