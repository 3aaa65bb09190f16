// Kernels as the device runs them: thread blocks in any order, the threads of one as fibers that
// switch at barriers, in any order. One block runs at any time, on the thread of the host that
// needs its result.
//
// A barrier that some threads of a block reach while others have ended is a violation.
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

// The running kernel; `running` is true only while its code runs on this thread.
struct RunningThread {
  bool running = false;
  uint32_t block = 0, thread = 0;
  uint32_t first = 0, number = 0;  // of this launch's first thread and of this one, of all launches
  const KernelLaunch* launch = nullptr;
};
extern thread_local RunningThread g_running;

// The stacks of all fibers.
bool on_fiber_stack(const void* p);

void block_barrier();

}  // namespace voxdag::cuda_sim
