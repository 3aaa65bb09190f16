// The part of the simulation that is compiled into the backend's sources: indices of blocks and
// threads, and launches of kernels.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <memory>

#include "tests/cuda_sim/sim/thread_blocks.h"

namespace voxdag::cuda_sim {

struct Index {
  unsigned x;
};
Index block_index();
Index thread_index();

// Queues a launch. Keeps `arguments` alive until the kernel has run.
cudaError_t queue_kernel(const KernelLaunch& launch, std::shared_ptr<void> arguments,
                         cudaStream_t stream);

}  // namespace voxdag::cuda_sim
