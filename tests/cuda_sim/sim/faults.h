// Calls that fail because a test wants them to, and the last error of each thread.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

namespace voxdag::cuda_sim {

// Releases are apart: nothing can be done about their failure.
enum class Call { kAllocation, kRelease, kOther };

struct Fault {
  Call call = Call::kOther;
  uint64_t skipped = 0;  // calls of this kind that succeed before
  cudaError_t status = cudaErrorLaunchFailure;
  // All later calls fail too, until the next plan; if an allocation failed, only allocations.
  bool sticky = false;
};

// Sets the next call to fail, replacing an earlier plan.
void plan_fault(const Fault& fault);
void plan_no_fault();
// True if the planned call was reached.
bool fault_happened();

// The status of a call that begins.
cudaError_t begin_call(Call call);
// Sets the thread's last error, and returns it.
cudaError_t fail(cudaError_t status);
cudaError_t last_error();

// Bytes of the device's pool in use, as the host sees it.
uint64_t bytes_in_use();

}  // namespace voxdag::cuda_sim
