// Thread block kernels. A thread block is a group of threads that work in phases on memory they
// share.
//
// A kernel K has
//   K::kThreads                  number of threads of a block
//   K::kPhases                   number of phases; between phases the threads wait for each other
//   K::kMinResidentBlocks        number of thread blocks whose registers must fit in one
//                                multiprocessor of a GPU at the same time
//   K::Shared                    the thread block's memory: plain data, uninitialized
//   operator()(phase, block, thread, Shared&)
//
// On a GPU the threads of a thread block run concurrently; on the host one thread runs them in
// turn, phase by phase, so that the tests execute the same index computations as the device.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag::parallel {

// Sets bits of a word that the threads of a thread block share. The order of ORs does not matter,
// so the result is deterministic.
VOXDAG_HD inline void or_shared(uint64_t& word, uint64_t bits) {
#if defined(__CUDA_ARCH__)
  unsigned int* half = reinterpret_cast<unsigned int*>(&word);
  const unsigned int low = static_cast<unsigned int>(bits);
  const unsigned int high = static_cast<unsigned int>(bits >> 32);
  if (low) atomicOr(half, low);
  if (high) atomicOr(half + 1, high);
#else
  word |= bits;
#endif
}

// Sets a flag that any thread of any thread block may set. No thread reads it during the kernel.
VOXDAG_HD inline void raise_flag(uint32_t* flag) {
#if defined(__CUDA_ARCH__)
  atomicOr(flag, 1u);
#else
  __atomic_store_n(flag, 1u, __ATOMIC_RELAXED);
#endif
}

}  // namespace voxdag::parallel
