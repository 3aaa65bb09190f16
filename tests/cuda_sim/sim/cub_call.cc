#include <cub/simulated_call.h>

#include <mutex>
#include <string>
#include <utility>

#include "tests/cuda_sim/sim/device_memory.h"
#include "tests/cuda_sim/sim/faults.h"
#include "tests/cuda_sim/sim/schedule.h"
#include "tests/cuda_sim/sim/streams.h"
#include "tests/cuda_sim/sim/violation.h"

namespace voxdag::cuda_sim {

cudaError_t cub_call(const char* name, void* storage, size_t& bytes, size_t n, cudaStream_t stream,
                     std::function<void()> work) {
  const std::lock_guard lock(device_lock());
  if (const cudaError_t status = begin_call(Call::kOther)) return status;
  if (last_error() != cudaSuccess) return last_error();
  const size_t needed = 767 + n / 4;
  if (!storage) {
    bytes = needed;
    return cudaSuccess;
  }
  if (bytes < needed) violation(std::string(name) + " has less storage than it asked for");
  queue(stream, {name, [=, work = std::move(work)] {
                   device_memory().expect_allocated(storage, needed, "CUB's storage,");
                   device_memory().spoil(storage, needed);
                   work();
                 }});
  return cudaSuccess;
}

void cub_reads(const void* p, size_t bytes) {
  device_memory().expect_written(p, bytes, "CUB reads");
}

void cub_may_read(const void* p, size_t bytes) {
  device_memory().expect_allocated(p, bytes, "CUB reads");
}

void cub_writes(void* p, size_t bytes) {
  device_memory().expect_allocated(p, bytes, "CUB writes");
  device_memory().mark_written(p, bytes);
}

void cub_spoils(void* p, size_t bytes) {
  device_memory().expect_allocated(p, bytes, "CUB writes");
  device_memory().spoil(p, bytes);
}

bool cub_coin() { return random_below(2) != 0; }

}  // namespace voxdag::cuda_sim
