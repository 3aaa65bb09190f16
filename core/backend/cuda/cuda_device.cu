#include <utility>
#include <vector>

#include "core/backend/cuda/cuda_device.h"
#include "core/backend/cuda/cuda_space.h"

namespace voxdag {
namespace cuda {
namespace {

constexpr int kMinMajor = 8;  // min compute capability (major number) that this build has code for

// Returns the CUDA runtime's numbers of the devices that can run this build. If there are no such
// devices, sets `problem` to the reason.
std::vector<int> usable_devices(std::string& problem) {
  int count = 0, driver = 0;
  const cudaError_t status = cudaGetDeviceCount(&count);
  if (status != cudaSuccess) {
    cudaGetLastError();
    const bool has_driver = cudaDriverGetVersion(&driver) == cudaSuccess && driver > 0;
    problem = std::string("no CUDA device: ") +
              (has_driver ? cudaGetErrorString(status) : "no NVIDIA driver is installed") +
              "; expected an NVIDIA GPU and its driver, or the backend cpu";
    return {};
  }
  std::vector<int> usable;
  for (int device = 0; device < count; ++device) {
    int major = 0, pools = 0;
    if (cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device) == cudaSuccess &&
        cudaDeviceGetAttribute(&pools, cudaDevAttrMemoryPoolsSupported, device) == cudaSuccess &&
        major >= kMinMajor && pools)
      usable.push_back(device);
    else
      // Clears the error, so that it is not taken for the failure of a later call.
      cudaGetLastError();
  }
  if (usable.empty())
    problem = "no usable CUDA device: expected compute capability 8.0 or later and memory pools";
  return usable;
}

// Returns the CUDA runtime's number of a device. `device`: index in usable_devices(). Throws
// Error{kDevice} if the device does not exist.
int runtime_device(int device) {
  std::string problem;
  const std::vector<int> usable = usable_devices(problem);
  if (usable.empty()) throw Error(ErrorCode::kDevice, problem);
  if (device < 0 || static_cast<size_t>(device) >= usable.size())
    throw Error(ErrorCode::kDevice, "no usable CUDA device has the number " +
                                        std::to_string(device) + ": expected 0 to " +
                                        std::to_string(usable.size() - 1));
  return usable[static_cast<size_t>(device)];
}

template <class T>
Pinned<T> make_pinned(size_t count, const std::string& where) {
  void* memory = nullptr;
  check_call(cudaMallocHost(&memory, count * sizeof(T)), "cudaMallocHost", where);
  return Pinned<T>(static_cast<T*>(memory));
}

}  // namespace

CudaDevice::CudaDevice(int device)
    : device_(runtime_device(device)), place_("CUDA device " + std::to_string(device_)) {
  check_call(cudaSetDevice(device_), "cudaSetDevice", place_);
  cudaStream_t stream = nullptr;
  check_call(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "cudaStreamCreate", place_);
  stream_.reset(stream);
  check_call(cudaDeviceGetDefaultMemPool(&pool_, device_), "cudaDeviceGetDefaultMemPool", place_);
  uint64_t retain_all = UINT64_MAX;  // the pool retains freed memory from one subvolume to the next
  check_call(cudaMemPoolSetAttribute(pool_, cudaMemPoolAttrReleaseThreshold, &retain_all),
             "cudaMemPoolSetAttribute", place_);
  mailbox_ = make_pinned<uint64_t>(1, place_);
  for (Staging& staging : staging_) {
    staging.triangles = make_pinned<FixedTriangle>(kStagingTriangles, place_);
    cudaEvent_t event = nullptr;
    check_call(cudaEventCreateWithFlags(&event, cudaEventDisableTiming), "cudaEventCreate", place_);
    staging.copied.reset(event);
  }
}

CudaSpace CudaDevice::open(const SubvolumeTask& task, MemoryBudget& budget,
                           const CancelToken& cancel) {
  check_call(cudaSetDevice(device_), "cudaSetDevice", place_);
  const Cube& cube = task.cube;
  return CudaSpace(*this,
                   place_ + ", subvolume of level " + std::to_string(cube.level) + " at " +
                       std::to_string(cube.position[0]) + " " + std::to_string(cube.position[1]) +
                       " " + std::to_string(cube.position[2]),
                   budget, cancel);
}

std::span<FixedTriangle> CudaDevice::free_staging(const std::string& where) {
  check_call(cudaEventSynchronize(staging_[next_staging_].copied.get()), "cudaEventSynchronize",
             where);
  return {staging_[next_staging_].triangles.get(), kStagingTriangles};
}

void CudaDevice::send_staging(size_t count, FixedTriangle* to, const std::string& where) {
  Staging& staging = staging_[next_staging_];
  check_call(cudaMemcpyAsync(to, staging.triangles.get(), count * sizeof(FixedTriangle),
                             cudaMemcpyHostToDevice, stream()),
             "cudaMemcpyAsync", where);
  check_call(cudaEventRecord(staging.copied.get(), stream()), "cudaEventRecord", where);
  next_staging_ ^= 1;
}

bool CudaDevice::allocate_download_area(uint64_t bytes, const std::string& where) {
  try {
    download_area_ = make_pinned<std::byte>(bytes, where);
  } catch (const OutOfBudget&) {
    return false;
  }
  download_area_bytes_ = bytes;
  return true;
}

uint64_t CudaDevice::available(const std::string& where) const {
  size_t free_bytes = 0, total_bytes = 0;
  uint64_t reserved = 0, used = 0;
  check_call(cudaMemGetInfo(&free_bytes, &total_bytes), "cudaMemGetInfo", where);
  check_call(cudaMemPoolGetAttribute(pool_, cudaMemPoolAttrReservedMemCurrent, &reserved),
             "cudaMemPoolGetAttribute", where);
  check_call(cudaMemPoolGetAttribute(pool_, cudaMemPoolAttrUsedMemCurrent, &used),
             "cudaMemPoolGetAttribute", where);
  // Other workers can allocate memory between the calls above, so `used` can exceed `reserved`.
  return free_bytes + (reserved > used ? reserved - used : 0);
}

void* CudaDevice::allocate(uint64_t bytes, const std::string& where) {
  void* memory = nullptr;
  cudaError_t status = cudaMallocAsync(&memory, bytes, stream());
  if (status == cudaErrorMemoryAllocation) {
    // The memory that the pool retains can be fragmented. Returns this memory to the device and
    // tries again.
    cudaGetLastError();
    check_call(cudaStreamSynchronize(stream()), "cudaStreamSynchronize", where);
    check_call(cudaMemPoolTrimTo(pool_, 0), "cudaMemPoolTrimTo", where);
    status = cudaMallocAsync(&memory, bytes, stream());
  }
  check_call(status, "cudaMallocAsync", where);
  return memory;
}

// Frees device memory in stream order. If this fails, clears the CUDA runtime's last error of this
// thread, because the next call of CUB would return this error as its own result.
void CudaDevice::release(void* memory) noexcept {
  if (cudaFreeAsync(memory, stream()) != cudaSuccess) cudaGetLastError();
}

}  // namespace cuda

int cuda_device_count() {
  std::string problem;
  return static_cast<int>(cuda::usable_devices(problem).size());
}

std::string cuda_device_problem() {
  std::string problem;
  cuda::usable_devices(problem);
  return problem;
}

}  // namespace voxdag
