// Which backend a build's workers open.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/backend/backend.h"
#include "core/base/progress.h"
#include "scheduler/build_spec.h"

namespace voxdag {

struct BackendChoice {
  std::string name;
  // Opens one backend a call, one call a worker.
  std::function<std::unique_ptr<Backend>()> open;
  unsigned max_workers = 256;  // more of them would not help
};

// Throws Error{kInvalidInput} for a backend or method that does not exist or do not go together,
// Error{kDevice} if there is no GPU for `cuda`.
void check_backend(const RunOptions& options);

// The choice for options that passed check_backend() and have their memory filled in. `auto` takes
// a GPU that is there, has the memory it needs and builds a few subvolumes like the CPU backend,
// else the CPU. Why a GPU that is there was not taken is a warning.
BackendChoice choose_backend(const RunOptions& options, Progress& progress);

// GPUs as `auto` sees them; tests have others.
struct Gpus {
  int count = 0;
  std::function<std::unique_ptr<Backend>(int device)> open;
};
BackendChoice choose_automatically(const Gpus& gpus, uint64_t memory_bytes, Progress& progress);

}  // namespace voxdag
