// The part of CUDA's language that kernels use, for the simulated device.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <memory>
#include <tuple>

#include "tests/cuda_sim/sim/launch.h"

#define __global__
#define __shared__
#define __launch_bounds__(...)
#define blockIdx (::voxdag::cuda_sim::block_index())
#define threadIdx (::voxdag::cuda_sim::thread_index())

inline void __syncthreads() { ::voxdag::cuda_sim::block_barrier(); }
inline int __popcll(unsigned long long x) { return __builtin_popcountll(x); }
inline int __ffsll(long long x) { return __builtin_ffsll(x); }
unsigned atomicOr(unsigned* word, unsigned bits);

struct dim3 {
  dim3(unsigned blocks = 1) : x(blocks) {}
  unsigned x, y = 1, z = 1;
};

struct cudaLaunchConfig_t {
  dim3 gridDim, blockDim;
  size_t dynamicSmemBytes;
  cudaStream_t stream;
};

// Queues a launch, with a copy of the arguments.
template <class... Parameters, class... Arguments>
cudaError_t cudaLaunchKernelEx(const cudaLaunchConfig_t* config, void (*kernel)(Parameters...),
                               Arguments&&... arguments) {
  struct Call {
    void (*kernel)(Parameters...);
    std::tuple<Parameters...> arguments;
  };
  const auto call = std::make_shared<Call>(Call{kernel, {arguments...}});
  voxdag::cuda_sim::KernelLaunch launch;
  launch.blocks = config->gridDim.x;
  launch.threads = config->blockDim.x;
  launch.shared_bytes = config->dynamicSmemBytes;
  launch.run_thread = [](void* packed) {
    const Call& now = *static_cast<const Call*>(packed);
    std::apply(now.kernel, now.arguments);
  };
  launch.arguments = call.get();
  launch.argument_bytes = sizeof(Call);
  return voxdag::cuda_sim::queue_kernel(launch, call, config->stream);
}
