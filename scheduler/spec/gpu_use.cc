#include "scheduler/spec/gpu_use.h"

#include <climits>

namespace voxdag {
namespace {

// Time to build subvolumes, per unit of their weight. Measured for scans, on an H100 and its host.
// CPU and GPU both build scenes of large flat triangles several times as fast (docs/gpu.md).
constexpr double kCpuSecondsPerBrick = 60e-9;  // for one thread
constexpr double kGpuSecondsPerBrick = 5e-9;
// Time to start CUDA and to check the GPU.
constexpr double kGpuStartSeconds = 0.3;

}  // namespace

bool are_gpus_faster(double bricks, unsigned threads, int gpus) {
  if (gpus == 0) return false;
  return kGpuStartSeconds + kGpuSecondsPerBrick * bricks / gpus <
         kCpuSecondsPerBrick * bricks / threads;
}

int gpus_to_use(const RunOptions& options, VoxelRule rule, double bricks) {
  if (options.backend == BackendName::kCuda) return cuda_device_count();
  // If a method is given, `auto` means the CPU backend, because check_backend() accepts only the
  // CPU's methods with `auto`.
  if (options.backend != BackendName::kAuto || options.method != MethodName::kDefault ||
      !traits_of(rule).is_parallel)
    return 0;
  // Does not start CUDA for a small build, for which no number of GPUs is faster.
  if (!are_gpus_faster(bricks, options.threads, INT_MAX)) return 0;
  const int count = cuda_device_count();
  return are_gpus_faster(bricks, options.threads, count) ? count : 0;
}

}  // namespace voxdag
