#include "scheduler/memory_limits.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>

namespace voxdag {
namespace {

// The limit of this process's cgroup (version 2, or 1 where that is mounted), or no limit.
uint64_t cgroup_memory() {
  uint64_t least = UINT64_MAX;
  for (const char* path :
       {"/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"}) {
    std::ifstream file(path);
    uint64_t bytes = 0;
    if (file >> bytes) least = std::min(least, bytes);  // "max" does not parse: no limit
  }
  return least;
}

// A size that the kernel tells about this process; 0 where it does not.
uint64_t status_bytes(const std::string& name) {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line)) {
    if (!line.starts_with(name)) continue;
    std::istringstream fields(line.substr(name.size()));
    uint64_t kib = 0;
    fields >> kib;
    return kib << 10;
  }
  return 0;
}

}  // namespace

uint64_t default_memory() {
  const uint64_t ram = static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) *
                       static_cast<uint64_t>(sysconf(_SC_PAGE_SIZE));
  return std::max(kLeastMemory, std::min(ram, cgroup_memory()) / 2);
}

uint64_t peak_resident_bytes() { return status_bytes("VmHWM:"); }
uint64_t resident_bytes() { return status_bytes("VmRSS:"); }

}  // namespace voxdag
