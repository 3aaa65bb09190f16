// The CUDA backend on the simulated device, in place of the backends that run on this machine.
#include <cstdlib>
#include <string>
#include <utility>

#include "tests/conformance/harness.h"
#include "tests/cuda_sim/sim/faults.h"
#include "tests/cuda_sim/sim/schedule.h"
#include "tests/cuda_sim/sim/streams.h"

namespace voxdag {
namespace {

// Wraps the CUDA backend. Runs every subvolume with another schedule (schedule.h), and checks that
// the build releases all device memory.
class Checked : public Backend {
 public:
  explicit Checked(Method method) : backend_(make_cuda_backend(method)) {}
  std::string_view name() const override { return backend_->name(); }
  BuildOutcome build(const SubvolumeTask& task, TriangleStream& triangles, MemoryBudget& budget,
                     const CancelToken& cancel, SubDagSink& sink, SubDagSummary& summary) override {
    cuda_sim::set_schedule({seed_ % 2 == 1, seed_});
    ++seed_;
    const LeakCheck check;
    return backend_->build(task, triangles, budget, cancel, sink, summary);
  }

 private:
  struct LeakCheck {
    ~LeakCheck() { EXPECT_EQ(cuda_sim::bytes_in_use(), 0u) << "device memory was not released"; }
  };
  std::unique_ptr<Backend> backend_;
  static inline uint64_t seed_ = [] {
    const char* first = std::getenv("VOXDAG_CUDA_SIM_SEED");
    return first ? std::strtoull(first, nullptr, 10) : 1;
  }();
};

}  // namespace

std::vector<BackendUnderTest> backends_under_test() {
  std::vector<BackendUnderTest> all;
  for (const auto& [name, method] : {std::pair{"cuda_sim_fast", Method::kFast},
                                     {"cuda_sim_hashes", Method::kHashes},
                                     {"cuda_sim_pointers", Method::kPointers}})
    all.push_back({name, [method = method] { return std::make_unique<Checked>(method); }});
  return all;
}

}  // namespace voxdag
