// The shared memory of the running thread block, and its race detector, which works on words of 4
// bytes. These accesses are violations:
//   - Between two barriers, one thread writes a word and another thread reads or writes it, unless
//     both accesses are atomic.
//   - A thread reads bytes that no thread of its block has written.
//   - A thread accesses bytes beyond the size that the launch requested.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxdag::cuda_sim {

inline constexpr size_t kMaxSharedBytes = size_t{48} << 10;

enum class Access { kRead, kWrite, kAtomic };

// Begins a block: forgets what earlier blocks wrote, and allows accesses to `shared_bytes` bytes.
void begin_block(size_t shared_bytes);
// Ends an interval between two barriers. Call it when all threads of the block have reached the
// barrier, before any of them continues.
void next_interval();

bool in_shared_memory(const void* p);
void shared_access(const void* p, size_t bytes, Access access, uint32_t thread);

}  // namespace voxdag::cuda_sim
