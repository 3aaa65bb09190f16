#include "scheduler/stages/build/choose_backend.h"

#include <algorithm>
#include <atomic>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/fields/field.h"
#include "scheduler/spec/gpu_use.h"

namespace voxdag {
namespace {

// Minimum memory budget with which `auto` uses a GPU. A CUDA context has several hundred MiB of
// resident memory that no budget contains.
constexpr uint64_t kMinMemoryForGpu = uint64_t{2} << 30;

[[noreturn]] void refuse_backend(const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, what);
}

Method method_of(const RunOptions& options) {
  if (options.method == MethodName::kPointers) return Method::kPointers;
  if (options.method == MethodName::kHashes) return Method::kHashes;
  return Method::kFast;
}

BackendChoice cpu_choice() {
  return {"cpu", [] { return make_cpu_backend(); }};
}

// Returns the choice of the backend `cuda`. Each call of its open() opens the next GPU, in turn.
BackendChoice gpu_choice(const Gpus& gpus) {
  const auto next = std::make_shared<std::atomic<int>>(0);
  return {"cuda", [gpus, next] { return gpus.open((*next)++ % gpus.count); },
          kWorkersPerGpu * static_cast<unsigned>(gpus.count)};
}

Gpus cuda_gpus(Method method) {
  return {cuda_device_count(), [method](int device) { return make_cuda_backend(method, device); }};
}

// Returns the reason why a GPU must not be used; "" if it may be used.
std::string fault_of(const Gpus& gpus, int device) {
  try {
    return difference_from_cpu(*gpus.open(device));
  } catch (const Error& error) {
    return error.what();
  }
}

}  // namespace

void check_backend(const RunOptions& options, VoxelRule rule) {
  const std::string backend = name_of(options.backend), method = name_of(options.method);
  const bool parallel =
      options.backend == BackendName::kParallelHost || options.backend == BackendName::kCuda;
  if (parallel && !traits_of(rule).is_parallel)
    refuse_backend("backend " + backend + ": it does not have the rule '" + traits_of(rule).name +
                   "'; expected " + option_text("backend", "cpu") + " or " +
                   option_text("backend", "auto"));
  const bool is_given = options.method != MethodName::kDefault;
  if (is_given && parallel == (options.method == MethodName::kConsing))
    refuse_backend(
        "method '" + method + "': backend " + backend + " does not have it: expected " +
        (parallel
             ? option_text("method", "pointers") + " or " + option_text("method", "hashes")
             : option_text("backend", "parallel-host") + " or " + option_text("backend", "cuda")));
  if (options.backend == BackendName::kCuda && !cuda_device_available())
    throw Error(ErrorCode::kDevice, "backend cuda: " + cuda_device_problem());
}

BackendChoice choose_backend(const RunOptions& options, VoxelRule rule, double bricks,
                             Progress& progress) {
  const Method method = method_of(options);
  if (options.backend == BackendName::kParallelHost)
    return {"parallel-host", [method] { return make_parallel_host_backend(method); }};
  if (options.backend == BackendName::kCuda) return gpu_choice(cuda_gpus(method));
  if (gpus_to_use(options, rule, bricks) == 0) return cpu_choice();
  return choose_automatically(cuda_gpus(method), options.memory_bytes, progress);
}

BackendChoice choose_automatically(const Gpus& gpus, uint64_t memory_bytes, Progress& progress) {
  if (gpus.count == 0) return cpu_choice();
  if (memory_bytes < kMinMemoryForGpu) {
    progress.warn("building on the CPU: a GPU needs " + option_text("memory") +
                  " of at least 2 GiB");
    return cpu_choice();
  }
  for (int device = 0; device < gpus.count; ++device) {
    const std::string fault = fault_of(gpus, device);
    if (fault.empty()) continue;
    progress.warn("building on the CPU: GPU " + std::to_string(device) +
                  " failed its check: " + fault);
    return cpu_choice();
  }
  return gpu_choice(gpus);
}

}  // namespace voxdag
