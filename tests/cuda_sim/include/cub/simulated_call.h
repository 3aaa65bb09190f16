// What all simulated calls of CUB do about their temporary storage.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <functional>

namespace voxdag::cuda_sim {

// First phase: answers the bytes that n items need. Second phase: queues `work`, before which the
// storage becomes junk. CUB returns the thread's last error as its own.
cudaError_t cub_call(const char* name, void* storage, size_t& bytes, size_t n, cudaStream_t stream,
                     std::function<void()> work);

// Declares the reads and writes of a call; forbidden ones are violations. Nothing may overlap the
// storage, and outputs may not overlap inputs unless the call `is_in_place`.
void cub_reads(const void* p, size_t bytes);
void cub_writes(void* p, size_t bytes, bool is_in_place = false);
void cub_spoils(void* p, size_t bytes);
bool cub_coin();

}  // namespace voxdag::cuda_sim
