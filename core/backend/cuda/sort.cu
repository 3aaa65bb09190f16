// Radix sorts on the device.
#include <cub/device/device_radix_sort.cuh>

#include "core/backend/cuda/cuda_space.h"

namespace voxdag::cuda {

void CudaSpace::sort_keys(Array<uint64_t>& keys, Array<uint64_t>& scratch, uint32_t n,
                          parallel::BitRange bits) {
  if (n == 0 || bits.begin == bits.end) return;
  cub::DoubleBuffer<uint64_t> buffers(keys.data(), scratch.data());
  with_storage("cub::DeviceRadixSort::SortKeys", [&](void* storage, size_t& bytes) {
    return cub::DeviceRadixSort::SortKeys(storage, bytes, buffers, n, bits.begin, bits.end,
                                          stream());
  });
  if (buffers.Current() != keys.data()) keys.swap(scratch);
}

void CudaSpace::sort_pairs(Array<uint64_t>& keys, Array<uint64_t>& key_scratch,
                           Array<uint32_t>& values, Array<uint32_t>& value_scratch, uint32_t n,
                           parallel::BitRange bits) {
  if (n == 0 || bits.begin == bits.end) return;
  cub::DoubleBuffer<uint64_t> key_buffers(keys.data(), key_scratch.data());
  cub::DoubleBuffer<uint32_t> value_buffers(values.data(), value_scratch.data());
  with_storage("cub::DeviceRadixSort::SortPairs", [&](void* storage, size_t& bytes) {
    return cub::DeviceRadixSort::SortPairs(storage, bytes, key_buffers, value_buffers, n,
                                           bits.begin, bits.end, stream());
  });
  if (key_buffers.Current() != keys.data()) keys.swap(key_scratch);
  if (value_buffers.Current() != values.data()) values.swap(value_scratch);
}

}  // namespace voxdag::cuda
