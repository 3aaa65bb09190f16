// The parallel pipeline on the host's threads.
#include <algorithm>
#include <thread>

#include "core/backend/parallel/parallel_backend.h"
#include "core/backend/parallel/space/host_space.h"

namespace voxdag {
namespace parallel {
namespace {

struct HostDevice {
  static constexpr std::string_view kName = "parallel-host";
  unsigned threads;
  HostSpace open(const SubvolumeTask&, MemoryBudget& budget, const CancelToken& cancel) const {
    return {budget, cancel, threads};
  }
};

}  // namespace
}  // namespace parallel

std::unique_ptr<Backend> make_parallel_host_backend(Method method, unsigned threads) {
  if (threads == 0) threads = std::max(1u, std::thread::hardware_concurrency());
  return std::make_unique<parallel::ParallelBackend<parallel::HostDevice>>(
      parallel::HostDevice{threads}, method);
}

}  // namespace voxdag
