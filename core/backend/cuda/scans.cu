// Scans, selections and reductions on the device.
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include <cub/device/device_reduce.cuh>
#include <cub/device/device_scan.cuh>
#include <cub/device/device_select.cuh>
#include <cuda/std/functional>

#include "core/backend/cuda/cuda_space.h"

namespace voxdag::cuda {
namespace {

struct Popcount {
  VOXDAG_HD uint64_t operator()(uint64_t mask) const {
    return static_cast<uint64_t>(popcount64(mask));
  }
};

}  // namespace

void CudaSpace::scan(uint32_t* counts, uint32_t n) {
  // CUB also reads counts[n], so it must be initialized. The total that CUB writes there does not
  // include this value.
  check(cudaMemsetAsync(counts + n, 0, sizeof(uint32_t), stream()), "cudaMemsetAsync");
  with_storage("cub::DeviceScan::ExclusiveSum", [&](void* storage, size_t& bytes) {
    return cub::DeviceScan::ExclusiveSum(storage, bytes, counts, counts, n + 1, stream());
  });
}

uint32_t CudaSpace::select(const uint8_t* flags, uint32_t n, uint32_t* out) {
  if (n == 0) return 0;
  with_storage("cub::DeviceSelect::Flagged", [&](void* storage, size_t& bytes) {
    return cub::DeviceSelect::Flagged(storage, bytes, thrust::counting_iterator<uint32_t>(0), flags,
                                      out, answer<uint32_t>(), n, stream());
  });
  return value(answer<uint32_t>());
}

uint32_t CudaSpace::merge_runs(const uint64_t* keys, const uint64_t* masks, uint32_t n,
                               uint64_t* out_keys, uint64_t* out_masks) {
  if (n == 0) return 0;
  with_storage("cub::DeviceReduce::ReduceByKey", [&](void* storage, size_t& bytes) {
    return cub::DeviceReduce::ReduceByKey(storage, bytes, keys, out_keys, masks, out_masks,
                                          answer<uint32_t>(), ::cuda::std::bit_or<uint64_t>(), n,
                                          stream());
  });
  return value(answer<uint32_t>());
}

uint64_t CudaSpace::count_bits(const uint64_t* masks, uint32_t n) {
  if (n == 0) return 0;
  const auto counts = thrust::make_transform_iterator(masks, Popcount{});
  with_storage("cub::DeviceReduce::Sum", [&](void* storage, size_t& bytes) {
    return cub::DeviceReduce::Sum(storage, bytes, counts, answer<uint64_t>(), n, stream());
  });
  return value(answer<uint64_t>());
}

}  // namespace voxdag::cuda
