// The one way to call the CUDA runtime: every status is checked, running out of device memory is an
// answer (split the subvolume), and anything else an Error{kDevice} that names the call and the
// place.
#pragma once

#include <cuda_runtime_api.h>

#include <string>

#include "core/backend/parallel/space.h"
#include "core/base/error.h"

namespace voxdag::cuda {

// `call`: the runtime's or CUB's function; `where`: device and subvolume.
inline void check_call(cudaError_t status, const char* call, const std::string& where) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // an error that has been reported does not stay behind
  if (status == cudaErrorMemoryAllocation) throw parallel::Outgrown{};
  throw Error(ErrorCode::kDevice, std::string(call) + " failed on " + where + ": " +
                                      cudaGetErrorString(status) + " (" + cudaGetErrorName(status) +
                                      ")");
}

}  // namespace voxdag::cuda
