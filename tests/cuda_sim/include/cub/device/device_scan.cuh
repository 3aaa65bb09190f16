#pragma once

#include <cub/simulated_call.h>

#include <cstdint>

namespace cub {

struct DeviceScan {
  template <class T>
  static cudaError_t ExclusiveSum(void* storage, size_t& bytes, const T* in, T* out, uint32_t n,
                                  cudaStream_t stream) {
    namespace sim = voxdag::cuda_sim;
    return sim::cub_call("cub::DeviceScan::ExclusiveSum", storage, bytes, n, stream, [=] {
      sim::cub_reads(in, n * sizeof(T));
      T sum = 0;
      for (uint32_t i = 0; i < n; ++i) {
        const T value = in[i];
        out[i] = sum;
        sum += value;
      }
      sim::cub_writes(out, n * sizeof(T), in == out);
    });
  }
};

}  // namespace cub
