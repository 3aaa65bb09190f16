// One GPU for one backend: a stream, and pinned host memory for small transfers. One thread uses a
// CudaDevice for many subvolumes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/backend/backend.h"
#include "core/backend/cuda/cuda_handles.h"
#include "core/base/memory_budget.h"
#include "core/geometry/fixed_triangle.h"
#include "voxdag/cancel_token.h"

namespace voxdag::cuda {

class CudaSpace;

class CudaDevice {
 public:
  static constexpr std::string_view kName = "cuda";
  static constexpr size_t kStagingTriangles = 4096;  // capacity of a staging area (288 KiB)
  static constexpr uint64_t kMinDownloadArea = uint64_t{1} << 20;   // bytes
  static constexpr uint64_t kMaxDownloadArea = uint64_t{64} << 20;  // bytes

  // `device`: index among the devices that can run this build. Throws Error{kDevice} with the
  // reason if the device does not exist or a call of the CUDA runtime fails.
  explicit CudaDevice(int device);

  // Returns the space (space.h) of one build, and makes this device the thread's current CUDA
  // device.
  CudaSpace open(const SubvolumeTask& task, MemoryBudget& budget, const CancelToken& cancel);

  cudaStream_t stream() const { return stream_.get(); }
  // Returns a word of pinned host memory, to which single values are copied from the device.
  void* mailbox() { return mailbox_.get(); }

  // Returns a pinned staging area of kStagingTriangles triangles. Waits until the last copy from
  // this area is complete. For `where`, see check_call().
  std::span<FixedTriangle> free_staging(const std::string& where);
  // Copies triangles to device memory at `to`, in stream order: the first `count` triangles of the
  // area that free_staging() returned last.
  void send_staging(size_t count, FixedTriangle* to, const std::string& where);

  // Pinned host memory for downloads. It is retained from one build to the next until
  // release_download_area() is called. All downloads must have finished before that call.
  // allocate_download_area() returns false if the system has not enough memory. Call it only if the
  // device has no download area.
  bool allocate_download_area(uint64_t bytes, const std::string& where);
  void release_download_area() {
    download_area_.reset();
    download_area_bytes_ = 0;
  }
  std::byte* download_area() { return download_area_.get(); }
  uint64_t download_area_bytes() const { return download_area_bytes_; }

  // Returns the free bytes of the device, including the bytes that the device's memory pool
  // retains.
  uint64_t available(const std::string& where) const;
  // Allocates device memory in stream order. Throws OutOfBudget if there is not enough.
  void* allocate(uint64_t bytes, const std::string& where);
  void release(void* memory) noexcept;

 private:
  struct Staging {
    Pinned<FixedTriangle> triangles;
    Event copied;
  };

  int device_ = 0;  // the CUDA runtime's number of the device
  std::string place_;
  cudaMemPool_t pool_ = nullptr;  // memory pool of this device
  Pinned<uint64_t> mailbox_;
  Staging staging_[2];
  int next_staging_ = 0;
  Pinned<std::byte> download_area_;
  uint64_t download_area_bytes_ = 0;
  // Last member, so that its destructor waits for pending work before the other members are
  // destroyed.
  Stream stream_;
};

}  // namespace voxdag::cuda
