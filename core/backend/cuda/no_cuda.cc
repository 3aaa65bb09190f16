// Replaces the CUDA backend in builds without CUDA.
#include <string>

#include "core/backend/backend.h"
#include "core/base/error.h"

namespace voxdag {

int cuda_device_count() { return 0; }

std::string cuda_device_problem() {
#ifdef VOXDAG_CUDA_IS_OFF
  constexpr const char *kReason = "with -DVOXDAG_CUDA=OFF", *kRemedy = "-DVOXDAG_CUDA=ON and nvcc";
#else
  constexpr const char *kReason = "without nvcc", *kRemedy = "nvcc (CUDA 12 or newer)";
#endif
  return std::string("this voxdag was compiled ") + kReason +
         ": expected the backend auto, cpu or parallel-host, or a voxdag compiled with " + kRemedy;
}

std::unique_ptr<Backend> make_cuda_backend(Method, int) {
  throw Error(ErrorCode::kDevice, cuda_device_problem());
}

}  // namespace voxdag
