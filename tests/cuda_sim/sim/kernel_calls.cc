// The functions that kernels call.
#include <cuda_runtime.h>

#include "tests/cuda_sim/sim/shared_memory.h"

namespace voxdag::cuda_sim {

Index block_index() { return {g_running.block}; }
Index thread_index() { return {g_running.thread}; }

void atomic_access(void* p, size_t bytes);

}  // namespace voxdag::cuda_sim

unsigned atomicOr(unsigned* word, unsigned bits) {
  voxdag::cuda_sim::atomic_access(word, sizeof(*word));
  const unsigned before = *word;
  *word |= bits;
  return before;
}
