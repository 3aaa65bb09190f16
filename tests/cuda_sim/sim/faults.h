// Simulates failures: a test chooses which call of the runtime fails. Also stores the last error of
// each thread, as the runtime does.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

namespace voxdag::cuda_sim {

// The kinds of calls. Releases of memory are a separate kind, because the backend cannot react to a
// failed release.
enum class Call { kAllocation, kRelease, kOther };

struct Fault {
  Call call = Call::kOther;
  uint64_t skipped = 0;  // number of calls of this kind that succeed before the failure
  cudaError_t status = cudaErrorLaunchFailure;
  // True if later calls also fail, until the next plan. If `call` is kOther, all later calls fail.
  // Otherwise only later allocations fail.
  bool sticky = false;
};

// Plans a failure. Replaces an earlier plan, and clears the thread's last error.
void plan_fault(const Fault& fault);
void plan_no_fault();
// True if the planned failure has happened.
bool fault_happened();

// Every call of the runtime begins with this function. Returns the status with which the call must
// fail, or cudaSuccess.
cudaError_t begin_call(Call call);
// Sets the thread's last error to `status`, and returns `status`.
cudaError_t fail(cudaError_t status);
cudaError_t last_error();

// Bytes that the host has allocated from the device's pool and has not released.
uint64_t bytes_in_use();

}  // namespace voxdag::cuda_sim
