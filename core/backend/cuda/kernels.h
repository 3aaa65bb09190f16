// The kernels of the CUDA backend, and the function that launches them. No other code runs on the
// device apart from CUB's. Only for CUDA sources, and for the simulated device (tests/cuda_sim).
#pragma once

#include <cuda_runtime.h>

#include <cstdint>
#include <string>
#include <type_traits>

#include "core/backend/cuda/cuda_handles.h"
#include "core/base/host_device.h"

namespace voxdag::cuda {

inline constexpr unsigned kThreadsPerBlock = 256;
// Bytes of shared memory that a thread block can use on every device without a special request.
inline constexpr size_t kMaxSharedBytes = size_t{48} << 10;

template <class F>
__global__ void __launch_bounds__(kThreadsPerBlock) run_for_each(uint32_t n, F f) {
  const uint32_t i = blockIdx.x * kThreadsPerBlock + threadIdx.x;
  if (i < n) f(i);
}

// Runs a thread block kernel (core/backend/parallel/space/thread_block.h). The launch must request
// sizeof(Kernel::Shared) bytes of shared memory.
template <class Kernel>
__global__ void __launch_bounds__(Kernel::kThreads, Kernel::kMinResidentBlocks)
    run_block(Kernel kernel) {
  using Shared = typename Kernel::Shared;
  static_assert(std::is_trivial_v<Shared> && sizeof(Shared) <= kMaxSharedBytes);
  alignas(16) extern __shared__ unsigned char block_memory[];
  Shared& shared = *reinterpret_cast<Shared*>(block_memory);
#pragma unroll
  for (int phase = 0; phase < Kernel::kPhases; ++phase) {
    if (phase > 0) __syncthreads();
    kernel(phase, blockIdx.x, threadIdx.x, shared);
  }
}

// Computes output i of CudaSpace::expand(). Finds the output's source by bisection.
template <class F>
struct ExpandOne {
  const uint32_t* offsets;
  uint32_t first, last;
  F f;
  VOXDAG_HD void operator()(uint32_t i) const {
    const uint32_t base = offsets[first], output = i + base;
    uint32_t source = first, end = last;
    while (end - source > 1) {
      const uint32_t middle = source + (end - source) / 2;
      if (offsets[middle] <= output)
        source = middle;
      else
        end = middle;
    }
    f(source, output - offsets[source], i);
  }
};

struct Grid {
  unsigned blocks, threads;
  size_t shared_bytes = 0;
};

// Launches a kernel. All launches use this function. For `where`, see check_call().
template <class... Parameters>
void launch(const Grid& grid, cudaStream_t stream, const std::string& where,
            void (*kernel)(Parameters...), std::type_identity_t<Parameters>... arguments) {
  cudaLaunchConfig_t config = {};
  config.gridDim = dim3(grid.blocks);
  config.blockDim = dim3(grid.threads);
  config.dynamicSmemBytes = grid.shared_bytes;
  config.stream = stream;
  check_call(cudaLaunchKernelEx(&config, kernel, arguments...), "kernel launch", where);
}

}  // namespace voxdag::cuda
