#include <cub/simulated_call.h>

#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "tests/cuda_sim/sim/device_memory.h"
#include "tests/cuda_sim/sim/faults.h"
#include "tests/cuda_sim/sim/schedule.h"
#include "tests/cuda_sim/sim/streams.h"
#include "tests/cuda_sim/sim/violation.h"

namespace voxdag::cuda_sim {
namespace {

struct Range {
  const char* begin = nullptr;
  size_t bytes = 0;
  bool overlaps(const void* p, size_t other_bytes) const {
    const char* at = static_cast<const char*>(p);
    return begin < at + other_bytes && at < begin + bytes;
  }
};
// The storage of the running call, and the inputs that it has declared so far.
Range g_storage;
std::vector<Range> g_read;

void expect_not_storage(const void* p, size_t bytes) {
  if (g_storage.overlaps(p, bytes)) violation("CUB's storage overlaps its other arguments");
}

}  // namespace

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
                   g_storage = {static_cast<const char*>(storage), needed};
                   g_read.clear();
                   work();
                 }});
  return cudaSuccess;
}

void cub_reads(const void* p, size_t bytes) {
  expect_not_storage(p, bytes);
  g_read.push_back({static_cast<const char*>(p), bytes});
  device_memory().expect_written(p, bytes, "CUB reads");
}

void cub_writes(void* p, size_t bytes, bool is_in_place) {
  expect_not_storage(p, bytes);
  for (const Range& read : g_read)
    if (!is_in_place && read.overlaps(p, bytes)) violation("CUB writes what it reads");
  device_memory().expect_allocated(p, bytes, "CUB writes");
  device_memory().mark_written(p, bytes);
}

void cub_spoils(void* p, size_t bytes) {
  expect_not_storage(p, bytes);
  device_memory().expect_allocated(p, bytes, "CUB writes");
  device_memory().spoil(p, bytes);
}

bool cub_coin() {
  const std::lock_guard lock(device_lock());
  return random_below(2) != 0;
}

}  // namespace voxdag::cuda_sim
