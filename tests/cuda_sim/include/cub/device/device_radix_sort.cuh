#pragma once

#include <cub/simulated_call.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

namespace cub {

template <class T>
struct DoubleBuffer {
  DoubleBuffer(T* current, T* alternate) : d_buffers{current, alternate} {}
  T* Current() { return d_buffers[selector]; }
  T* Alternate() { return d_buffers[selector ^ 1]; }
  T* d_buffers[2];
  int selector = 0;
};

// The sorted result is in one of the two buffers, chosen at random; the other buffer is filled with
// junk. The choice is made when the call is queued, because CUB also sets the selectors at that
// time.
struct DeviceRadixSort {
  template <class K>
  static cudaError_t SortKeys(void* storage, size_t& bytes, DoubleBuffer<K>& keys, uint32_t n,
                              int begin_bit, int end_bit, cudaStream_t stream) {
    const auto k = plan(storage, keys);
    return voxdag::cuda_sim::cub_call("cub::DeviceRadixSort::SortKeys", storage, bytes, n, stream,
                                      [=] { apply(order(k, n, begin_bit, end_bit), k); });
  }

  template <class K, class V>
  static cudaError_t SortPairs(void* storage, size_t& bytes, DoubleBuffer<K>& keys,
                               DoubleBuffer<V>& values, uint32_t n, int begin_bit, int end_bit,
                               cudaStream_t stream) {
    const auto k = plan(storage, keys);
    const auto v = plan(storage, values);
    return voxdag::cuda_sim::cub_call("cub::DeviceRadixSort::SortPairs", storage, bytes, n, stream,
                                      [=] {
                                        const auto sorted = order(k, n, begin_bit, end_bit);
                                        apply(sorted, k);
                                        apply(sorted, v);
                                      });
  }

 private:
  template <class T>
  struct Plan {
    T *from, *to, *other;  // `to` is the buffer for the result, `other` the other buffer
  };

  template <class T>
  static Plan<T> plan(void* storage, DoubleBuffer<T>& buffers) {
    T* from = buffers.Current();
    if (storage && voxdag::cuda_sim::cub_coin()) buffers.selector ^= 1;
    return {from, buffers.Current(), buffers.Alternate()};
  }

  template <class K>
  static std::vector<uint32_t> order(const Plan<K>& keys, uint32_t n, int begin_bit, int end_bit) {
    voxdag::cuda_sim::cub_reads(keys.from, n * sizeof(K));
    const int unused = 64 - (end_bit - begin_bit);
    const auto digits = [&](uint32_t i) {
      return static_cast<uint64_t>(keys.from[i]) >> begin_bit << unused;
    };
    std::vector<uint32_t> sorted(n);
    std::iota(sorted.begin(), sorted.end(), 0u);
    std::stable_sort(sorted.begin(), sorted.end(),
                     [&](uint32_t a, uint32_t b) { return digits(a) < digits(b); });
    return sorted;
  }

  template <class T>
  static void apply(const std::vector<uint32_t>& sorted, const Plan<T>& plan) {
    const size_t bytes = sorted.size() * sizeof(T);
    voxdag::cuda_sim::cub_reads(plan.from, bytes);
    std::vector<T> result;
    for (const uint32_t i : sorted) result.push_back(plan.from[i]);
    voxdag::cuda_sim::cub_writes(plan.to, bytes, true);
    std::copy(result.begin(), result.end(), plan.to);
    voxdag::cuda_sim::cub_spoils(plan.other, bytes);
  }
};

}  // namespace cub
