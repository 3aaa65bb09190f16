// The space of a GPU: its loops are kernels on one stream, and its memory is device memory.
// core/backend/parallel/space/space.h defines spaces and specifies the calls. Only for CUDA
// sources.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "core/backend/cuda/cuda_device.h"
#include "core/backend/cuda/kernels.h"
#include "core/backend/parallel/space/space.h"

namespace voxdag::cuda {

class CudaSpace {
 public:
  static constexpr bool kOnHost = false;
  static constexpr uint64_t kWindow = uint64_t{1} << 22;
  static constexpr uint32_t kMaxTiles = 4096;
  template <class T>
  using Array = parallel::SpaceArray<CudaSpace, T>;

  CudaSpace(CudaDevice& device, std::string where, MemoryBudget& budget, const CancelToken& cancel)
      : device_(device),
        where_(std::move(where)),
        budget_(budget),
        cancel_(cancel),
        area_charge_(budget, 0, "download area") {
    if (!area_charge_.try_resize(device_.download_area_bytes())) device_.release_download_area();
  }
  CudaSpace(const CudaSpace&) = delete;

  MemoryBudget& budget() { return budget_; }
  uint64_t available() const { return std::min(budget_.available(), device_.available(where_)); }
  void* allocate(uint64_t bytes) { return device_.allocate(bytes, where_); }
  void release(void* memory, uint64_t) { device_.release(memory); }

  template <class F>
  void for_each(uint64_t n, F f) {
    cancel_.check();
    if (n == 0) return;
    const unsigned blocks = static_cast<unsigned>((n + kThreadsPerBlock - 1) / kThreadsPerBlock);
    launch({blocks, kThreadsPerBlock}, stream(), where_, run_for_each<F>, static_cast<uint32_t>(n),
           f);
  }

  template <class Kernel>
  void for_each_thread_block(uint32_t blocks, Kernel kernel) {
    cancel_.check();
    if (blocks == 0) return;
    launch({blocks, Kernel::kThreads, sizeof(typename Kernel::Shared)}, stream(), where_,
           run_block<Kernel>, kernel);
  }

  template <class F>
  void expand(const uint32_t* offsets, uint32_t first, uint32_t last, uint32_t count, F f) {
    for_each(count, ExpandOne<F>{offsets, first, last, f});
  }

  void scan(uint32_t* counts, uint32_t n);
  uint32_t select(const uint8_t* flags, uint32_t n, uint32_t* out);
  uint32_t merge_runs(const uint64_t* keys, const uint64_t* masks, uint32_t n, uint64_t* out_keys,
                      uint64_t* out_masks);
  uint64_t count_bits(const uint64_t* masks, uint32_t n);
  void sort_keys(Array<uint64_t>& keys, Array<uint64_t>& scratch, uint32_t n,
                 parallel::BitRange bits);
  void sort_pairs(Array<uint64_t>& keys, Array<uint64_t>& key_scratch, Array<uint32_t>& values,
                  Array<uint32_t>& value_scratch, uint32_t n, parallel::BitRange bits);

  template <class T>
  void copy(const T* from, T* to, uint64_t n) {
    transfer(from, to, n, cudaMemcpyDeviceToDevice);
  }
  template <class T>
  void upload(const T* from, T* to, uint64_t n) {
    transfer(from, to, n, cudaMemcpyHostToDevice);
    // Waits for the copy, because the caller can free `from` after this call. On some systems an
    // asynchronous copy would still read `from` then.
    check(cudaStreamSynchronize(stream()), "cudaStreamSynchronize");
  }
  template <class T>
  void download(const T* from, T* to, uint64_t n) {
    begin_download(from, to, n);
    finish_downloads();
  }
  template <class T>
  T value(const T* from) {
    static_assert(sizeof(T) <= sizeof(uint64_t));
    download(from, static_cast<T*>(device_.mailbox()), 1);
    return *static_cast<T*>(device_.mailbox());
  }
  std::byte* download_area(uint64_t bytes) {
    if (bytes > device_.download_area_bytes()) {
      device_.release_download_area();
      area_charge_.try_resize(0);
      const uint64_t rounded = std::bit_ceil(std::max(bytes, CudaDevice::kMinDownloadArea));
      if (rounded > CudaDevice::kMaxDownloadArea || !area_charge_.try_resize(rounded) ||
          !device_.allocate_download_area(rounded, where_)) {
        area_charge_.try_resize(0);
        return nullptr;
      }
    }
    return device_.download_area();
  }
  template <class T>
  void begin_download(const T* from, T* to, uint64_t n) {
    transfer(from, to, n, cudaMemcpyDeviceToHost);
  }
  void finish_downloads() { check(cudaStreamSynchronize(stream()), "cudaStreamSynchronize"); }
  std::span<FixedTriangle> staging(FixedTriangle*, uint64_t max_count) {
    cancel_.check();
    const auto area = device_.free_staging(where_);
    return area.first(std::min<uint64_t>(area.size(), max_count));
  }
  void upload_staged(std::span<const FixedTriangle> area, FixedTriangle* to) {
    device_.send_staging(area.size(), to, where_);
  }

 private:
  cudaStream_t stream() const { return device_.stream(); }
  void check(cudaError_t status, const char* call) const { check_call(status, call, where_); }
  template <class T>
  void transfer(const T* from, T* to, uint64_t n, cudaMemcpyKind kind) {
    cancel_.check();
    if (n == 0) return;
    check(cudaMemcpyAsync(to, from, n * sizeof(T), kind, stream()), "cudaMemcpyAsync");
  }
  // Runs the two phases of a function of CUB: call(nullptr, bytes) sets `bytes` to the size of the
  // temporary storage, and call(storage, bytes) does the work. The storage is retained for the next
  // call.
  template <class Call>
  void with_storage(const char* name, Call call) {
    cancel_.check();
    size_t bytes = 0;
    check(call(nullptr, bytes), name);
    if (bytes > storage_.size() || storage_.size() == 0) {
      storage_ = {};
      storage_ = Array<uint8_t>(*this, std::max<size_t>(bytes, 1));
    }
    check(call(storage_.data(), bytes), name);
  }

  template <class T>
  T* answer() {
    if (answer_.size() == 0) answer_ = Array<uint64_t>(*this, 1);
    return reinterpret_cast<T*>(answer_.data());
  }

  CudaDevice& device_;
  const std::string where_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  MemoryCharge area_charge_;  // charge for the device's download area
  Array<uint8_t> storage_;
  Array<uint64_t> answer_;  // one word, for the results of reductions
};

}  // namespace voxdag::cuda
