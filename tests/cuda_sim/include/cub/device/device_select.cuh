#pragma once

#include <cub/simulated_call.h>

#include <cstdint>

namespace cub {

struct DeviceSelect {
  template <class In, class T>
  static cudaError_t Flagged(void* storage, size_t& bytes, In in, const uint8_t* flags, T* out,
                             uint32_t* selected, uint32_t n, cudaStream_t stream) {
    namespace sim = voxdag::cuda_sim;
    return sim::cub_call("cub::DeviceSelect::Flagged", storage, bytes, n, stream, [=] {
      sim::cub_reads(flags, n);
      uint32_t count = 0;
      for (uint32_t i = 0; i < n; ++i) count += flags[i] != 0;
      sim::cub_writes(out, count * sizeof(T));
      sim::cub_writes(selected, sizeof(*selected));
      *selected = count;
      T* next = out;
      for (uint32_t i = 0; i < n; ++i)
        if (flags[i]) *next++ = in[i];
    });
  }
};

}  // namespace cub
