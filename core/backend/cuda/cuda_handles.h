// Checked calls of the CUDA runtime, and RAII owners of its handles.
#pragma once

#include <cuda_runtime_api.h>

#include <memory>
#include <string>
#include <type_traits>

#include "core/base/error.h"
#include "core/base/memory_budget.h"

namespace voxdag::cuda {

// Checks a call of the runtime. If device memory is exhausted, throws OutOfBudget, so that the
// subvolume is split. For any other failure, throws Error{kDevice} whose message names the call and
// the place. `call`: the function of the runtime or of CUB; `where`: device and subvolume.
inline void check_call(cudaError_t status, const char* call, const std::string& where) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // clears the error, which is reported here
  if (status == cudaErrorMemoryAllocation) throw OutOfBudget{};
  throw Error(ErrorCode::kDevice, std::string(call) + " failed on " + where + ": " +
                                      cudaGetErrorString(status) + " (" + cudaGetErrorName(status) +
                                      ")");
}

// Waits for the stream's work before it destroys the stream. After a failed build, this work can
// still be reading pinned memory.
struct DestroyStream {
  void operator()(cudaStream_t stream) const {
    cudaStreamSynchronize(stream);
    cudaStreamDestroy(stream);
  }
};
struct DestroyEvent {
  void operator()(cudaEvent_t event) const { cudaEventDestroy(event); }
};
struct FreePinned {
  void operator()(void* memory) const { cudaFreeHost(memory); }
};

using Stream = std::unique_ptr<std::remove_pointer_t<cudaStream_t>, DestroyStream>;
using Event = std::unique_ptr<std::remove_pointer_t<cudaEvent_t>, DestroyEvent>;
// Page-locked host memory, for asynchronous copies.
template <class T>
using Pinned = std::unique_ptr<T[], FreePinned>;

}  // namespace voxdag::cuda
