#include "tests/cuda_sim/sim/faults.h"

#include <optional>

namespace voxdag::cuda_sim {
namespace {

std::optional<Fault> g_fault;
bool g_happened = false;
thread_local cudaError_t g_last = cudaSuccess;

}  // namespace

void plan_fault(const Fault& fault) {
  g_fault = fault;
  g_happened = false;
  g_last = cudaSuccess;
}

void plan_no_fault() {
  g_fault.reset();
  g_happened = false;
  g_last = cudaSuccess;
}

bool fault_happened() { return g_happened; }

cudaError_t begin_call(Call call) {
  if (!g_fault) return cudaSuccess;
  if (g_happened) {
    const bool concerned = g_fault->call == Call::kOther || call == Call::kAllocation;
    return g_fault->sticky && concerned ? fail(g_fault->status) : cudaSuccess;
  }
  if (g_fault->call != call || g_fault->skipped-- > 0) return cudaSuccess;
  g_happened = true;
  return fail(g_fault->status);
}

cudaError_t fail(cudaError_t status) { return g_last = status; }

cudaError_t last_error() { return g_last; }

}  // namespace voxdag::cuda_sim
