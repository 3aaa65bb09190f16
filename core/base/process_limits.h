// How much memory the machine lets a build have, and how much it took.
#pragma once

#include <cstdint>
#include <string>

namespace voxdag {

// The least that --memory accepts.
inline constexpr uint64_t kMinMemory = uint64_t{64} << 20;

// Half of what RAM and cgroups allow, at least kMinMemory.
uint64_t default_memory();
// The least limit of the cgroups that `membership` (the text of /proc/self/cgroup) names and of
// those above them, of version 2 or 1, mounted under `mount`; UINT64_MAX if there is none.
uint64_t cgroup_memory(const std::string& membership, const std::string& mount);
// Largest resident set of this process so far (VmHWM), in bytes.
uint64_t peak_resident_bytes();
// What it holds now (VmRSS), in bytes.
uint64_t resident_bytes();

}  // namespace voxdag
