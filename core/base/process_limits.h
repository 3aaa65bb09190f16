// How much memory and how many CPUs the machine lets a build have, how much this process holds, and
// the allocator settings without which it would hold more than it was charged. Thread-safe.
#pragma once

#include <cstdint>
#include <string>

namespace voxdag {

// The smallest --memory that is accepted, in bytes.
inline constexpr uint64_t kMinMemory = uint64_t{64} << 20;

// Half of what RAM and cgroups allow, at least kMinMemory; bytes.
uint64_t default_memory();
// The lowest limit of the cgroups that `membership` (the text of /proc/self/cgroup) names and of
// their ancestors, of version 2 or 1, mounted under `mount`; UINT64_MAX without one.
uint64_t cgroup_memory(const std::string& membership, const std::string& mount);
// The CPUs that this process may use: its affinity mask's, or fewer if a cgroup has a quota.
unsigned default_threads();
// The lowest quota of the cgroups as above, in CPUs and rounded up; UINT64_MAX without a quota.
uint64_t cgroup_cpus(const std::string& membership, const std::string& mount);
// Largest resident set of this process so far (VmHWM), in bytes.
uint64_t peak_resident_bytes();
// Resident set of this process now (VmRSS), in bytes.
uint64_t resident_bytes();
// How many files and sockets this process may have open (RLIMIT_NOFILE).
uint64_t max_open_files();

// Makes the C library return freed memory to the system immediately, so that resident memory
// follows the charges of a MemoryBudget. Called by main() only: the setting is process-wide, so a
// library must leave it to its host program. No effect without glibc.
void return_freed_memory_to_system();
// Returns the pages of small freed blocks, which the C library retains despite the settings above;
// for use after many of them were freed. No effect without glibc.
void trim_heap();

}  // namespace voxdag
