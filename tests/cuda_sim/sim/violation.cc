#include "tests/cuda_sim/sim/violation.h"

#include <csignal>
#include <cstdio>
#include <cstdlib>

#include "tests/cuda_sim/sim/device_memory.h"
#include "tests/cuda_sim/sim/schedule.h"

namespace voxdag::cuda_sim {
namespace {

const char* g_operation = nullptr;

// Handles the fault of a host that accesses device memory, which has no access rights while the
// host runs.
void on_fault(int signal, siginfo_t* info, void*) {
  if (device_memory().contains(info->si_addr))
    violation("the host touched device memory outside of a copy");
  std::signal(signal, SIG_DFL);  // the access is repeated, and ends the process
}

}  // namespace

void set_current_operation(const char* name) { g_operation = name; }

void violation(const std::string& what) {
  const Schedule now = schedule();
  std::fprintf(stderr, "cuda_sim: %s%s%s (schedule %s, seed %llu)\n", what.c_str(),
               g_operation ? ", in " : "", g_operation ? g_operation : "",
               now.late ? "late" : "random", static_cast<unsigned long long>(now.seed));
  std::abort();
}

void catch_host_accesses() {
  struct sigaction action = {};
  action.sa_sigaction = on_fault;
  action.sa_flags = SA_SIGINFO | SA_NODEFER;
  sigaction(SIGSEGV, &action, nullptr);
}

}  // namespace voxdag::cuda_sim
