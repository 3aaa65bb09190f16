// Chooses the backend of a build's workers. Thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/backend/backend.h"
#include "core/base/progress.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

struct BackendChoice {
  std::string name;
  // Opens one backend per call; every worker calls it once.
  std::function<std::unique_ptr<Backend>()> open;
  unsigned max_workers = 256;  // more workers do not make the build faster
};

// Throws Error{kInvalidInput} for a method or a rule that the backend does not support, or
// Error{kDevice} for `cuda` on a machine without a usable GPU.
void check_backend(const RunOptions& options, VoxelRule rule);

// Returns the backend for options that passed check_backend() and whose memory_bytes is set.
// `bricks`: total weight of the subvolumes. `auto` uses the GPUs if they are faster, if the budget
// is large enough for them, and if each GPU builds a few test subvolumes exactly like the CPU
// backend. Otherwise it uses the CPU, with a warning if the GPUs would be faster.
BackendChoice choose_backend(const RunOptions& options, VoxelRule rule, double bricks,
                             Progress& progress);

// The machine's GPUs. Tests pass simulated GPUs.
struct Gpus {
  int count = 0;
  std::function<std::unique_ptr<Backend>(int device)> open;
};
// Returns the backend for `auto` if these GPUs are faster than the CPU.
BackendChoice choose_automatically(const Gpus& gpus, uint64_t memory_bytes, Progress& progress);

// Compares a backend with the CPU backend on this machine, because a faulty driver or device could
// produce wrong voxels unnoticed. Builds a few small subvolumes, with 1200 triangles of all sizes
// and with several hash lengths. Returns "" if all level arrays and counts are equal, else a
// sentence with the difference. Propagates the backend's exceptions. Building the subvolumes on the
// CPU takes about 30 ms.
std::string difference_from_cpu(Backend& backend);

}  // namespace voxdag
