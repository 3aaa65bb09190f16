// Replaces the CUDA backend in builds without CUDA.
#include "core/backend/backend.h"
#include "core/base/error.h"

namespace voxdag {

int cuda_device_count() { return 0; }

std::string cuda_device_problem() {
  return "this voxdag was compiled without CUDA: expected the backend auto, cpu or parallel-host, "
         "or a voxdag that was compiled with nvcc";
}

std::unique_ptr<Backend> make_cuda_backend(Method, int) {
  throw Error(ErrorCode::kDevice, cuda_device_problem());
}

}  // namespace voxdag
