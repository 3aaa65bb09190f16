// Streams whose operations run late. A call of the runtime only queues an operation. The operation
// runs when a synchronization needs its result, or earlier if the schedule (schedule.h) decides so.
// In both cases it runs inside a call of the runtime, on the host thread that makes this call. This
// thread holds device_lock() during the operation.
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
    // The range of host memory that the operation reads or writes, or null.
    const char* host = nullptr;
    size_t host_bytes = 0;
  };
  std::deque<Operation> waiting;
  uint64_t queued = 0;  // number of all operations so far, including finished ones
  bool destroyed = false;
};

struct CUevent_st {
  cudaStream_t stream = nullptr;  // null: never recorded
  uint64_t position = 0;
};

namespace voxdag::cuda_sim {

// Returns the lock that every call of the runtime holds.
std::recursive_mutex& device_lock();

cudaStream_t create_stream();
// Forbids further operations in the stream. Operations that are already queued still run later.
void destroy_stream(cudaStream_t stream);
void queue(cudaStream_t stream, CUstream_st::Operation operation);
// Runs the operations of the stream that were queued first, until `position` operations have run
// since the stream was created.
void run_until(cudaStream_t stream, uint64_t position);
void run_everything();
// At random, runs some of the queued operations of all streams. Does nothing if Schedule::late is
// true.
void run_some();
// True if a queued operation will read or write a part of this range of host memory.
bool is_in_use(const void* memory, size_t bytes);

}  // namespace voxdag::cuda_sim
