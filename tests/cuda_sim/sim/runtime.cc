// The functions of the CUDA runtime. Each of them takes device_lock(), fails if a failure is
// planned, and otherwise first lets the schedule run some of the queued operations.
#include <sys/mman.h>

#include <cstring>
#include <map>
#include <memory>
#include <string_view>

#include "tests/cuda_sim/sim/device_memory.h"
#include "tests/cuda_sim/sim/faults.h"
#include "tests/cuda_sim/sim/launch.h"
#include "tests/cuda_sim/sim/streams.h"
#include "tests/cuda_sim/sim/violation.h"

using namespace voxdag::cuda_sim;

namespace {

constexpr size_t kDeviceBytes = size_t{256} << 20;

std::map<const void*, size_t> g_allocated;  // device memory that the host has not released
std::map<const void*, size_t> g_pinned;
uint64_t g_in_use = 0;

// Begins a call of the runtime. Usage: `Begin call; if (call.status) return call.status;`.
struct Begin {
  explicit Begin(Call kind = Call::kOther) : lock(device_lock()), status(begin_call(kind)) {
    static const bool watched = (catch_host_accesses(), true);
    static_cast<void>(watched);
    if (status == cudaSuccess) run_some();
  }
  std::lock_guard<std::recursive_mutex> lock;
  cudaError_t status;
};

size_t hash_of(const void* memory, size_t bytes) {
  return std::hash<std::string_view>{}({static_cast<const char*>(memory), bytes});
}

// Checks that the device range of a copy or memset is within one allocation that the host has not
// released.
void expect_known(const void* p, size_t bytes, const char* what) {
  const auto next = g_allocated.upper_bound(p);
  if (next != g_allocated.begin()) {
    const auto& [begin, size] = *std::prev(next);
    const char* end = static_cast<const char*>(begin) + size;
    if (static_cast<const char*>(p) + bytes <= end) return;
  }
  violation(std::string(what) + " of a copy or memset is not within an allocation");
}

CUstream_st::Operation upload(void* to, const void* from, size_t bytes) {
  const size_t hash = hash_of(from, bytes);
  return {"an upload",
          [=] {
            DeviceMemory& memory = device_memory();
            memory.expect_allocated(to, bytes, "an upload writes");
            if (hash_of(from, bytes) != hash)
              violation("the source of an upload changed before the upload ran");
            std::memcpy(to, from, bytes);
            memory.mark_written(to, bytes);
          },
          static_cast<const char*>(from), bytes};
}

CUstream_st::Operation download(void* to, const void* from, size_t bytes) {
  std::memset(to, 0xe7, bytes);  // a host that reads too early gets junk
  return {"a download",
          [=] {
            device_memory().expect_written(from, bytes, "a download reads");
            std::memcpy(to, from, bytes);
          },
          static_cast<const char*>(to), bytes};
}

CUstream_st::Operation copy(void* to, const void* from, size_t bytes) {
  return {"a copy", [=] {
            DeviceMemory& memory = device_memory();
            memory.expect_written(from, bytes, "a copy reads");
            memory.expect_allocated(to, bytes, "a copy writes");
            std::memcpy(to, from, bytes);
            memory.copy_state(from, to, bytes);
          }};
}

}  // namespace

namespace voxdag::cuda_sim {

uint64_t bytes_in_use() { return g_in_use; }

cudaError_t queue_kernel(const KernelLaunch& launch, std::shared_ptr<void> arguments,
                         cudaStream_t stream) {
  Begin call;
  if (call.status) return call.status;
  if (launch.blocks == 0 || launch.blocks > 0x7fffffff || launch.threads == 0 ||
      launch.threads > 1024 || launch.shared_bytes > size_t{48} << 10)
    return fail(cudaErrorInvalidConfiguration);
  queue(stream, {"a kernel", [launch, arguments] { run_kernel(launch); }});
  return cudaSuccess;
}

}  // namespace voxdag::cuda_sim

cudaError_t cudaGetLastError() {
  const cudaError_t last = last_error();
  fail(cudaSuccess);
  return last;
}

const char* cudaGetErrorName(cudaError_t status) {
  return status == cudaErrorMemoryAllocation ? "cudaErrorMemoryAllocation"
         : status == cudaErrorLaunchFailure  ? "cudaErrorLaunchFailure"
                                             : "cudaErrorOther";
}

const char* cudaGetErrorString(cudaError_t status) {
  return status == cudaErrorMemoryAllocation ? "out of memory"
         : status == cudaErrorLaunchFailure  ? "unspecified launch failure"
                                             : "a simulated error";
}

cudaError_t cudaGetDeviceCount(int* count) {
  *count = 1;
  return Begin().status;
}

cudaError_t cudaDriverGetVersion(int* version) {
  *version = 13000;
  return cudaSuccess;
}

cudaError_t cudaDeviceGetAttribute(int* value, cudaDeviceAttr attribute, int) {
  *value = attribute == cudaDevAttrComputeCapabilityMajor ? 9 : 1;
  return Begin().status;
}

cudaError_t cudaSetDevice(int device) {
  return device == 0 ? Begin().status : fail(cudaErrorInvalidValue);
}

cudaError_t cudaDeviceGetDefaultMemPool(cudaMemPool_t* pool, int) {
  *pool = nullptr;
  return Begin().status;
}

cudaError_t cudaMemPoolSetAttribute(cudaMemPool_t, cudaMemPoolAttr, void*) {
  return Begin().status;
}

// Returns the memory in use for every attribute: the simulated pool keeps no unused memory.
cudaError_t cudaMemPoolGetAttribute(cudaMemPool_t, cudaMemPoolAttr, void* value) {
  const Begin call;
  *static_cast<uint64_t*>(value) = g_in_use;
  return call.status;
}

cudaError_t cudaMemPoolTrimTo(cudaMemPool_t, size_t) { return Begin().status; }

cudaError_t cudaMemGetInfo(size_t* free_bytes, size_t* total_bytes) {
  const Begin call;
  *total_bytes = kDeviceBytes;
  *free_bytes = kDeviceBytes - g_in_use;
  return call.status;
}

cudaError_t cudaMallocAsync(void** memory, size_t bytes, cudaStream_t stream) {
  Begin call(Call::kAllocation);
  if (call.status) return call.status;
  if (bytes > kDeviceBytes - g_in_use) return fail(cudaErrorMemoryAllocation);
  void* taken = device_memory().reserve(bytes);
  if (!taken) {
    run_everything();
    taken = device_memory().reserve(bytes);
  }
  if (!taken) return fail(cudaErrorMemoryAllocation);
  g_allocated[taken] = bytes;
  g_in_use += bytes;
  queue(stream, {"an allocation", [=] { device_memory().begin_life(taken, bytes, 0); }});
  *memory = taken;
  return cudaSuccess;
}

cudaError_t cudaFreeAsync(void* memory, cudaStream_t stream) {
  Begin call(Call::kRelease);
  const auto known = g_allocated.find(memory);
  if (known == g_allocated.end()) violation("memory is released that is not allocated");
  g_in_use -= known->second;
  g_allocated.erase(known);
  queue(stream, {"a release", [=] { device_memory().end_life(memory); }});
  return call.status;
}

cudaError_t cudaMallocHost(void** memory, size_t bytes) {
  Begin call(Call::kAllocation);
  if (call.status) return call.status;
  *memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (*memory == MAP_FAILED) return fail(cudaErrorMemoryAllocation);
  std::memset(*memory, 0xc3, bytes);
  g_pinned[*memory] = bytes;
  return cudaSuccess;
}

cudaError_t cudaFreeHost(void* memory) {
  Begin call(Call::kRelease);
  const auto known = g_pinned.find(memory);
  if (known == g_pinned.end()) violation("pinned memory is released that is not allocated");
  if (is_in_use(memory, known->second))
    violation("pinned memory is released that a queued copy uses");
  munmap(memory, known->second);
  g_pinned.erase(known);
  return call.status;
}

cudaError_t cudaStreamCreateWithFlags(cudaStream_t* stream, unsigned) {
  Begin call(Call::kAllocation);
  if (call.status) return call.status;
  *stream = create_stream();
  return cudaSuccess;
}

cudaError_t cudaStreamSynchronize(cudaStream_t stream) {
  Begin call;
  run_until(stream, stream->queued);
  return call.status;
}

cudaError_t cudaStreamDestroy(cudaStream_t stream) {
  Begin call(Call::kRelease);
  destroy_stream(stream);
  return call.status;
}

cudaError_t cudaEventCreateWithFlags(cudaEvent_t* event, unsigned) {
  Begin call(Call::kAllocation);
  if (call.status) return call.status;
  *event = new CUevent_st;
  return cudaSuccess;
}

cudaError_t cudaEventRecord(cudaEvent_t event, cudaStream_t stream) {
  Begin call;
  if (call.status) return call.status;
  *event = {stream, stream->queued};
  return cudaSuccess;
}

cudaError_t cudaEventSynchronize(cudaEvent_t event) {
  Begin call;
  if (event->stream) run_until(event->stream, event->position);
  return call.status;
}

cudaError_t cudaEventDestroy(cudaEvent_t event) {
  delete event;
  return cudaSuccess;
}

cudaError_t cudaMemsetAsync(void* memory, int value, size_t bytes, cudaStream_t stream) {
  Begin call;
  if (call.status) return call.status;
  expect_known(memory, bytes, "the target");
  queue(stream, {"a memset", [=] {
                   device_memory().expect_allocated(memory, bytes, "a memset writes");
                   std::memset(memory, value, bytes);
                   device_memory().mark_written(memory, bytes);
                 }});
  return cudaSuccess;
}

cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind kind,
                            cudaStream_t stream) {
  Begin call;
  if (call.status) return call.status;
  const bool from_device = kind != cudaMemcpyHostToDevice,
             to_device = kind != cudaMemcpyDeviceToHost;
  if (device_memory().contains(from) != from_device || device_memory().contains(to) != to_device)
    violation("a copy goes another way than it says");
  if (from_device) expect_known(from, bytes, "the source");
  if (to_device) expect_known(to, bytes, "the target");
  queue(stream, from_device ? to_device ? copy(to, from, bytes) : download(to, from, bytes)
                            : upload(to, from, bytes));
  return cudaSuccess;
}
