// CudaSpace::with_storage(), for the sources that call CUB.
#pragma once

#include <algorithm>

#include "core/backend/cuda/cuda_space.h"

namespace voxdag::cuda {

template <class Call>
void CudaSpace::with_storage(const char* name, Call call) {
  cancel_.check();
  size_t bytes = 0;
  check(call(nullptr, bytes), name);
  if (bytes > storage_.size() || storage_.size() == 0) {
    storage_ = {};
    storage_ = Array<uint8_t>(*this, std::max<size_t>(bytes, 1));
  }
  check(call(storage_.data(), bytes), name);
}

}  // namespace voxdag::cuda
