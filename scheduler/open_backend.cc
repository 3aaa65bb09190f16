#include "scheduler/open_backend.h"

#include "core/base/error.h"

namespace voxdag {
namespace {

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorCode::kInvalidInput, what); }

Method method_of(const RunOptions& options) {
  if (options.method.empty()) return Method::kFast;
  if (options.method == "pointers") return Method::kPointers;
  if (options.method == "hashes") return Method::kHashes;
  refuse("method '" + options.method + "': backend " + options.backend +
         " has pointers and hashes");
}

}  // namespace

std::function<std::unique_ptr<Backend>()> backend_opener(const RunOptions& options) {
  // No GPU run of the CUDA backend has been checked against the others yet, so that `auto` does not
  // choose it: docs/gpu.md.
  if (options.backend == "auto" || options.backend == "cpu") {
    if (!options.method.empty() && options.method != "consing")
      refuse("method '" + options.method +
             "': backend cpu has consing only; expected --backend "
             "parallel-host or cuda");
    return [] { return make_cpu_backend(); };
  }
  if (options.backend != "parallel-host" && options.backend != "cuda")
    refuse("backend '" + options.backend + "': expected auto, cpu, cuda or parallel-host");
  const Method method = method_of(options);
  if (options.backend == "parallel-host")
    return [method] { return make_parallel_host_backend(method); };
  if (!cuda_device_available())
    throw Error(ErrorCode::kDevice, "backend cuda: " + cuda_device_problem());
  return [method] { return make_cuda_backend(method); };
}

}  // namespace voxdag
