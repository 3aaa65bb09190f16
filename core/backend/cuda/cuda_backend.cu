// The parallel pipeline on a GPU.
#include "core/backend/cuda/cuda_space.h"
#include "core/backend/parallel/parallel_backend.h"

namespace voxdag {

std::unique_ptr<Backend> make_cuda_backend(Method method, int device) {
  try {
    return std::make_unique<parallel::ParallelBackend<cuda::CudaDevice>>(cuda::CudaDevice(device),
                                                                         method);
  } catch (const OutOfBudget&) {
    throw Error(ErrorCode::kDevice,
                "CUDA device " + std::to_string(device) +
                    " has no memory left: expected a device with free memory, or the backend cpu");
  }
}

}  // namespace voxdag
