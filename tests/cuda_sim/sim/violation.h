// Reports a violation of a CUDA rule and ends the process, even if hardware may tolerate the
// violation. The tests of the simulation expect that the process ends.
#pragma once

#include <string>

namespace voxdag::cuda_sim {

[[noreturn]] void violation(const std::string& what);

// Sets the name of the operation that the device executes, for the message of a violation. `name`
// is null between two operations.
void set_current_operation(const char* name);

// Makes a host access to device memory a violation. Called once.
void catch_host_accesses();

}  // namespace voxdag::cuda_sim
