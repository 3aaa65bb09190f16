// The shared memory of the thread block that runs, and its race detector: between two barriers, no
// word that one thread writes is touched by another, unless both use atomics. Words are of 4 bytes.
// What no thread of the block wrote is not read, and nothing beyond the bytes that the launch asked
// for is touched.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxdag::cuda_sim {

inline constexpr size_t kMaxSharedBytes = size_t{48} << 10;

enum class Access { kRead, kWrite, kAtomic };

// Discards the writes of the last block.
void begin_block(size_t shared_bytes);
// All threads passed a barrier.
void next_interval();

bool in_shared_memory(const void* p);
void shared_access(const void* p, size_t bytes, Access access, uint32_t thread);

}  // namespace voxdag::cuda_sim
