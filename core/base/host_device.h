// VOXDAG_HD marks a function that runs on the host and, in CUDA sources, also on the device (the
// GPU). Only this file and core/backend/ contain conditions on the CUDA compiler.
#pragma once

#include <cstdint>

#if defined(__CUDACC__)
#define VOXDAG_HD __host__ __device__
#else
#define VOXDAG_HD
#endif

// VOXDAG_SSE2 is defined in code for x86-64 CPUs, which all have SSE2. It is not defined in device
// code.
#if defined(__SSE2__) && !defined(__CUDA_ARCH__)
#define VOXDAG_SSE2
#endif

// VOXDAG_PREFETCH marks a function that only prefetches memory. GCC assumes that such a function
// has no effect, and removes calls of it unless the function is inlined.
#define VOXDAG_PREFETCH __attribute__((always_inline)) inline

namespace voxdag {

VOXDAG_HD inline int popcount64(uint64_t x) {
#if defined(__CUDA_ARCH__)
  return __popcll(x);
#else
  return __builtin_popcountll(x);
#endif
}

// Returns the position of the lowest set bit; x must not be 0.
VOXDAG_HD inline int lowest_bit(uint64_t x) {
#if defined(__CUDA_ARCH__)
  return __ffsll(static_cast<long long>(x)) - 1;
#else
  return __builtin_ctzll(x);
#endif
}

}  // namespace voxdag
