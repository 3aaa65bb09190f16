#pragma once

#include <cub/simulated_call.h>

#include <cstdint>

namespace cub {

struct DeviceReduce {
  template <class Key, class Value, class Operation>
  static cudaError_t ReduceByKey(void* storage, size_t& bytes, const Key* keys, Key* out_keys,
                                 const Value* values, Value* out_values, uint32_t* runs,
                                 Operation operation, uint32_t n, cudaStream_t stream) {
    namespace sim = voxdag::cuda_sim;
    return sim::cub_call("cub::DeviceReduce::ReduceByKey", storage, bytes, n, stream, [=] {
      sim::cub_reads(keys, n * sizeof(Key));
      sim::cub_reads(values, n * sizeof(Value));
      uint32_t count = 0;
      for (uint32_t i = 0; i < n; ++i) count += i == 0 || keys[i] != keys[i - 1];
      sim::cub_writes(out_keys, count * sizeof(Key));
      sim::cub_writes(out_values, count * sizeof(Value));
      sim::cub_writes(runs, sizeof(*runs));
      *runs = count;
      for (uint32_t i = 0, run = 0; i < n; ++run) {
        out_keys[run] = keys[i];
        Value sum = values[i];
        for (++i; i < n && keys[i] == keys[i - 1]; ++i) sum = operation(sum, values[i]);
        out_values[run] = sum;
      }
    });
  }

  template <class In, class T>
  static cudaError_t Sum(void* storage, size_t& bytes, In in, T* out, uint32_t n,
                         cudaStream_t stream) {
    namespace sim = voxdag::cuda_sim;
    return sim::cub_call("cub::DeviceReduce::Sum", storage, bytes, n, stream, [=] {
      sim::cub_reads(in.base, n * sizeof(*in.base));
      sim::cub_writes(out, sizeof(T));
      T sum = 0;
      for (uint32_t i = 0; i < n; ++i) sum += in[i];
      *out = sum;
    });
  }
};

}  // namespace cub
