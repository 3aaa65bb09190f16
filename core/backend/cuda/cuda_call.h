// Checked calls of the CUDA runtime: running out of device memory is OutOfBudget (the subvolume is
// split), any other failure an Error{kDevice} that names the call and the place.
#pragma once

#include <cuda_runtime_api.h>

#include <string>

#include "core/backend/out_of_budget.h"
#include "core/base/error.h"

namespace voxdag::cuda {

// `call`: the runtime's or CUB's function; `where`: device and subvolume.
inline void check_call(cudaError_t status, const char* call, const std::string& where) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // clears the error, which is reported here
  if (status == cudaErrorMemoryAllocation) throw OutOfBudget{};
  throw Error(ErrorCode::kDevice, std::string(call) + " failed on " + where + ": " +
                                      cudaGetErrorString(status) + " (" + cudaGetErrorName(status) +
                                      ")");
}

}  // namespace voxdag::cuda
