// Runs kernels as a device does. The thread blocks of a launch run one after the other, in random
// order. The threads of a block are fibers; they switch at barriers, in random order. All of this
// happens on the host thread that runs the stream's operations.
//
// It is a violation if some threads of a block wait at a barrier after others have ended.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxdag::cuda_sim {

struct KernelLaunch {
  const char* name = "";
  uint32_t blocks = 0, threads = 0;
  size_t shared_bytes = 0;
  void (*run_thread)(void* arguments) = nullptr;
  void* arguments = nullptr;
  size_t argument_bytes = 0;
};

void run_kernel(const KernelLaunch& launch);

// The simulated thread that runs on this host thread. `running` is true only while code of the
// kernel runs. The threads of all launches have different numbers, until the numbers would exceed
// 32 bits and begin at 1 again.
struct RunningThread {
  bool running = false;
  uint32_t block = 0, thread = 0;
  uint32_t first = 0, number = 0;  // numbers of the launch's first thread and of this thread
  const KernelLaunch* launch = nullptr;
};
extern thread_local RunningThread g_running;

// True if `p` is in the stack of a fiber.
bool on_fiber_stack(const void* p);

void block_barrier();

}  // namespace voxdag::cuda_sim
