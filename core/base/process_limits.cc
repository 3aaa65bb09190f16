#include "core/base/process_limits.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

namespace voxdag {
namespace {

uint64_t number_in(const std::string& path) {
  std::ifstream file(path);
  uint64_t bytes = 0;
  return file >> bytes ? bytes : UINT64_MAX;  // "max" does not parse: no limit
}

// The lowest limit from the group at `path` up to the root of the hierarchy.
uint64_t min_up_from(const std::string& root, std::string path, const std::string& file) {
  uint64_t lowest = UINT64_MAX;
  for (;;) {
    lowest = std::min(lowest, number_in(root + path + "/" + file));
    const size_t slash = path.find_last_of('/');
    if (path.empty() || slash == std::string::npos) return lowest;
    path.resize(slash);
  }
}

// A size in the kernel's status of this process; 0 where it is absent.
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

// A line is "<id>:<controllers>:<path>"; version 2 has no controllers there.
uint64_t cgroup_memory(const std::string& membership, const std::string& mount) {
  uint64_t lowest = UINT64_MAX;
  std::istringstream lines(membership);
  std::string line;
  while (std::getline(lines, line)) {
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const std::string path = line.substr(second + 1);
    if (controllers == ",,") {
      for (const char* root : {"", "/unified"})
        lowest = std::min(lowest, min_up_from(mount + root, path, "memory.max"));
    } else if (controllers.find(",memory,") != std::string::npos) {
      lowest = std::min(lowest, min_up_from(mount + "/memory", path, "memory.limit_in_bytes"));
    }
  }
  return lowest;
}

uint64_t default_memory() {
  const uint64_t ram = static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) *
                       static_cast<uint64_t>(sysconf(_SC_PAGE_SIZE));
  std::ifstream file("/proc/self/cgroup");
  const std::string membership{std::istreambuf_iterator<char>(file), {}};
  return std::max(kMinMemory, std::min(ram, cgroup_memory(membership, "/sys/fs/cgroup")) / 2);
}

uint64_t peak_resident_bytes() { return status_bytes("VmHWM:"); }
uint64_t resident_bytes() { return status_bytes("VmRSS:"); }

uint64_t max_open_files() {
  rlimit limit{};
  return getrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : UINT64_MAX;
}

void return_freed_memory_to_system() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 256 << 10);
  mallopt(M_TRIM_THRESHOLD, 1 << 20);
  mallopt(M_ARENA_MAX, 2);
#endif
}

void trim_heap() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

}  // namespace voxdag
