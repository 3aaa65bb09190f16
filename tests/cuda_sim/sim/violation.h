// Reports a violation of a CUDA rule that hardware may tolerate, and ends the process. A test of a
// rule expects the death.
#pragma once

#include <string>

namespace voxdag::cuda_sim {

[[noreturn]] void violation(const std::string& what);

// What the device executes now, for the message; null between two operations.
void set_current_operation(const char* name);

// Makes a host access to device memory a violation. Called once.
void catch_host_accesses();

}  // namespace voxdag::cuda_sim
