#include "core/base/process_limits.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <thread>

#include "core/base/text.h"

namespace voxdag {
namespace {

uint64_t number_in(const std::string& path) {
  std::ifstream file(path);
  uint64_t bytes = 0;
  return file >> bytes ? bytes : UINT64_MAX;  // "max", which is not a number, means no limit
}

// Returns the lowest limit of the cgroup `path` and its ancestors, up to the mount point `root`.
// limit_of(folder) reads the limit from a cgroup's folder.
template <class LimitOf>
uint64_t min_up_from(const std::string& root, std::string path, const LimitOf& limit_of) {
  uint64_t lowest = UINT64_MAX;
  for (;;) {
    lowest = std::min(lowest, limit_of(root + path + "/"));
    const size_t slash = path.find_last_of('/');
    if (path.empty() || slash == std::string::npos) return lowest;
    path.resize(slash);
  }
}

// Returns the lowest limit of all cgroups in `membership` (the text of /proc/self/cgroup) and of
// their ancestors. limit_of2() and limit_of1() read the limit from a cgroup's folder, for version 2
// and version 1 of cgroups. `controller` is "memory" or "cpu"; only version 1 needs it. A line of
// `membership` is "<id>:<controllers>:<path>". In version 2, <controllers> is empty.
template <class LimitOf2, class LimitOf1>
uint64_t min_of_groups(const std::string& membership, const std::string& mount,
                       const std::string& controller, const LimitOf2& limit_of2,
                       const LimitOf1& limit_of1) {
  uint64_t lowest = UINT64_MAX;
  std::istringstream lines(membership);
  std::string line;
  while (std::getline(lines, line)) {
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    std::string path = line.substr(second + 1);
    if (path == "/") path.clear();  // the root group is the mount point itself
    if (controllers.empty()) {
      // Systems with both versions mount version 2 at "unified".
      for (const char* root : {"", "/unified"})
        lowest = std::min(lowest, min_up_from(mount + root, path, limit_of2));
    } else if (("," + controllers + ",").find("," + controller + ",") != std::string::npos) {
      // Version 1 mounts a controller under its own name, or under the names of all controllers
      // that are mounted together with it.
      lowest = std::min(lowest, min_up_from(mount + "/" + controller, path, limit_of1));
      if (controllers != controller)
        lowest = std::min(lowest, min_up_from(mount + "/" + controllers, path, limit_of1));
    }
  }
  return lowest;
}

// Returns the number of CPUs, rounded up, that a cgroup may use: it gets `quota` microseconds of
// CPU time in every `period` microseconds. Returns UINT64_MAX if there is no quota.
uint64_t cpus(uint64_t quota, uint64_t period) {
  if (quota >= INT64_MAX || period == 0 || period >= INT64_MAX) return UINT64_MAX;
  return std::max<uint64_t>(1, (quota + period - 1) / period);
}

// Returns the contents of /proc/self/cgroup, which is read once.
const std::string& own_membership() {
  static const std::string membership = [] {
    std::ifstream file("/proc/self/cgroup");
    return std::string(std::istreambuf_iterator<char>(file), {});
  }();
  return membership;
}

constexpr const char* kCgroupMount = "/sys/fs/cgroup";

// Returns the size, in bytes, in the line of /proc/self/status that begins with `name`; 0 if there
// is no such line.
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

struct ErrnoCode {
  int reason;
  ErrorCode code;
};

constexpr ErrnoCode kCodes[] = {
    {ENOENT, ErrorCode::kNotFound},
    {ENOTDIR, ErrorCode::kNotFound},
    {ENOSPC, ErrorCode::kNoSpace},
    {EDQUOT, ErrorCode::kNoSpace},
    {EFBIG, ErrorCode::kNoSpace},
    {ENOMEM, ErrorCode::kOutOfMemory},
    {ENAMETOOLONG, ErrorCode::kInvalidInput},
};

// A limit of a process. System calls that would exceed it fail with the errno value `reason`.
struct ProcessLimit {
  int reason;
  __rlimit_resource resource;
  const char* name;
  bool is_size;  // true: a size in bytes, false: a count
};

constexpr ProcessLimit kLimits[] = {
    {EFBIG, RLIMIT_FSIZE, "file sizes, ulimit -f,", true},
    {EMFILE, RLIMIT_NOFILE, "open files, ulimit -n,", false},
    {EAGAIN, RLIMIT_NPROC, "processes and threads, ulimit -u,", false},
    {EAGAIN, RLIMIT_AS, "address space, ulimit -v,", true},
    {ENOMEM, RLIMIT_AS, "address space, ulimit -v,", true},
    {ENOMEM, RLIMIT_DATA, "data memory, ulimit -d,", true},
};

// Returns the limits of this process that can cause the errno value `reason`, as text: " (the limit
// of ... is ...)". Returns "" if no limit can cause it.
std::string limits_text(int reason) {
  std::string text;
  for (const ProcessLimit& limit : kLimits) {
    rlimit value{};
    if (limit.reason != reason || getrlimit(limit.resource, &value) != 0 ||
        value.rlim_cur == RLIM_INFINITY)
      continue;
    text += (text.empty() ? " (" : "; ") + std::string("the limit of ") + limit.name + " is " +
            (limit.is_size ? size_text(value.rlim_cur) : count_text(value.rlim_cur));
  }
  return text.empty() ? "" : text + ")";
}

}  // namespace

uint64_t cgroup_memory(const std::string& membership, const std::string& mount) {
  return min_of_groups(
      membership, mount, "memory",
      [](const std::string& folder) { return number_in(folder + "memory.max"); },
      [](const std::string& folder) { return number_in(folder + "memory.limit_in_bytes"); });
}

uint64_t cgroup_cpus(const std::string& membership, const std::string& mount) {
  return min_of_groups(
      membership, mount, "cpu",
      [](const std::string& folder) {
        std::ifstream file(folder + "cpu.max");
        uint64_t quota = 0, period = 0;
        return file >> quota >> period ? cpus(quota, period) : UINT64_MAX;
      },
      [](const std::string& folder) {
        // A quota of -1 means no quota. Read as an unsigned number, it is UINT64_MAX, for which
        // cpus() returns UINT64_MAX.
        return cpus(number_in(folder + "cpu.cfs_quota_us"),
                    number_in(folder + "cpu.cfs_period_us"));
      });
}

uint64_t usable_memory() {
  const uint64_t ram = static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) *
                       static_cast<uint64_t>(sysconf(_SC_PAGE_SIZE));
  return std::min(ram, cgroup_memory(own_membership(), kCgroupMount));
}

uint64_t default_memory() { return std::max(kMinMemory, usable_memory() / 2); }

unsigned default_threads() {
  // Computed once, because the computation reads up to a dozen files, and several commands declare
  // the number as the default of an option.
  static const auto threads = [] {
    const unsigned cpus = std::max(1u, std::thread::hardware_concurrency());
    return static_cast<unsigned>(
        std::min<uint64_t>(cpus, cgroup_cpus(own_membership(), kCgroupMount)));
  }();
  return threads;
}

uint64_t peak_resident_bytes() { return status_bytes("VmHWM:"); }
uint64_t resident_bytes() { return status_bytes("VmRSS:"); }

uint64_t max_open_files() {
  rlimit limit{};
  return getrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : UINT64_MAX;
}

ErrorCode code_of_errno(int reason) {
  for (const ErrnoCode& row : kCodes)
    if (row.reason == reason) return row.code;
  return ErrorCode::kIo;
}

std::string errno_text(int reason) {
  return std::generic_category().message(reason) + limits_text(reason);
}

Error out_of_memory_error() {
  return {ErrorCode::kOutOfMemory,
          "out of memory: the system refused an allocation" + limits_text(ENOMEM)};
}

Error error_of(const std::system_error& error) {
  const int reason = error.code().value();
  if (error.code() == std::errc::resource_unavailable_try_again)
    return {ErrorCode::kOutOfMemory, "cannot start a thread: " + errno_text(reason)};
  return {code_of_errno(reason), error.what() + limits_text(reason)};
}

void return_freed_memory_to_system() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 256 << 10);
  mallopt(M_TRIM_THRESHOLD, 1 << 20);
  // Each request for memory from the system is this much larger than needed, so there are fewer
  // requests. Only memory that the process uses becomes resident.
  mallopt(M_TOP_PAD, 512 << 10);
  mallopt(M_ARENA_MAX, 2);
#endif
}

void trim_heap() {
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 33)
  // A smaller part is not worth a system call for each of its blocks.
  constexpr size_t kMinFreeBytes = size_t{4} << 20;
  if (mallinfo2().fordblks < kMinFreeBytes) return;
#endif
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

}  // namespace voxdag
