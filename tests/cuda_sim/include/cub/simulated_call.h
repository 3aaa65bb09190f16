// The common part of all simulated CUB calls: their temporary storage, and checks of their
// accesses.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <functional>

namespace voxdag::cuda_sim {

// A CUB call has two phases. If `storage` is null, the call sets `bytes` to the size of the storage
// that n items need. Otherwise it queues `work` in the stream, and fills the storage with junk
// before `work` runs. Like CUB, it returns the thread's last error if an earlier call failed.
cudaError_t cub_call(const char* name, void* storage, size_t& bytes, size_t n, cudaStream_t stream,
                     std::function<void()> work);

// `work` must declare the reads and writes of its call with these functions. A range that overlaps
// the storage is a violation. An output that overlaps an input is also a violation, unless
// `is_in_place`. cub_spoils() declares an output with undefined contents and fills it with junk.
void cub_reads(const void* p, size_t bytes);
void cub_writes(void* p, size_t bytes, bool is_in_place = false);
void cub_spoils(void* p, size_t bytes);
bool cub_coin();

}  // namespace voxdag::cuda_sim
