// Streams that run late: work is queued, and runs when synchronization demands it, or earlier if
// the schedule decides so. All of it runs on the host thread that needs it, under one lock.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>

struct CUstream_st {
  struct Operation {
    const char* name = "";
    std::function<void()> run;
    // The host's memory that it reads or writes.
    const char* host = nullptr;
    size_t host_bytes = 0;
  };
  std::deque<Operation> waiting;
  uint64_t queued = 0;  // operations so far
  bool destroyed = false;
};

struct CUevent_st {
  cudaStream_t stream = nullptr;  // null: never recorded
  uint64_t position = 0;
};

namespace voxdag::cuda_sim {

// Held by every call of the runtime.
std::recursive_mutex& device_lock();

cudaStream_t create_stream();
// Its work runs all the same, some time.
void destroy_stream(cudaStream_t stream);
void queue(cudaStream_t stream, CUstream_st::Operation operation);
// Runs the first `position` operations that were ever queued, if they did not run yet.
void run_until(cudaStream_t stream, uint64_t position);
void run_everything();
// Runs some work, unless the schedule is late.
void run_some();
// True if work that did not run yet uses a range of the host's memory.
bool is_in_use(const void* memory, size_t bytes);

}  // namespace voxdag::cuda_sim
