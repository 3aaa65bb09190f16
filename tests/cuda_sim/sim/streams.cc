#include "tests/cuda_sim/sim/streams.h"

#include <algorithm>
#include <list>
#include <utility>

#include "tests/cuda_sim/sim/device_memory.h"
#include "tests/cuda_sim/sim/schedule.h"
#include "tests/cuda_sim/sim/violation.h"

namespace voxdag::cuda_sim {
namespace {

std::list<CUstream_st>& streams() {
  static auto& all = *new std::list<CUstream_st>;
  return all;
}

}  // namespace

std::recursive_mutex& device_lock() {
  static auto& lock = *new std::recursive_mutex;
  return lock;
}

cudaStream_t create_stream() { return &streams().emplace_back(); }

void destroy_stream(cudaStream_t stream) {
  if (stream->destroyed) violation("a stream is destroyed twice");
  stream->destroyed = true;
}

void queue(cudaStream_t stream, CUstream_st::Operation operation) {
  if (!stream || stream->destroyed) violation("work is queued in a stream that does not exist");
  stream->waiting.push_back(std::move(operation));
  ++stream->queued;
  run_some();
}

void run_until(cudaStream_t stream, uint64_t position) {
  if (stream->waiting.empty()) return;
  uint64_t done = stream->queued - stream->waiting.size();
  if (done >= position) return;
  device_memory().open(0);
  for (; done < position; ++done) {
    const CUstream_st::Operation now = std::move(stream->waiting.front());
    stream->waiting.pop_front();
    set_current_operation(now.name);
    now.run();
  }
  set_current_operation(nullptr);
  device_memory().close();
}

void run_everything() {
  for (CUstream_st& stream : streams()) run_until(&stream, stream.queued);
}

void run_some() {
  if (schedule().late || random_below(8) != 0) return;
  for (CUstream_st& stream : streams())
    if (const size_t n = stream.waiting.size())
      run_until(&stream, stream.queued - random_below(static_cast<uint32_t>(n) + 1));
}

bool is_in_use(const void* memory, size_t bytes) {
  const char* begin = static_cast<const char*>(memory);
  for (const CUstream_st& stream : streams())
    for (const auto& work : stream.waiting)
      if (work.host && work.host < begin + bytes && begin < work.host + work.host_bytes)
        return true;
  return false;
}

}  // namespace voxdag::cuda_sim
