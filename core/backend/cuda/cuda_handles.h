// RAII owners of the CUDA runtime's handles.
#pragma once

#include <cuda_runtime_api.h>

#include <memory>
#include <type_traits>

namespace voxdag::cuda {

struct DestroyStream {
  void operator()(cudaStream_t stream) const { cudaStreamDestroy(stream); }
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
