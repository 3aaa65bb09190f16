// How much memory the machine lets a build have, and how much it took.
#pragma once

#include <cstdint>

namespace voxdag {

// The least that --memory accepts.
inline constexpr uint64_t kLeastMemory = uint64_t{64} << 20;

// Half of what RAM and cgroup allow, at least kLeastMemory.
uint64_t default_memory();
// Largest resident set of this process so far (VmHWM), in bytes.
uint64_t peak_resident_bytes();
// What it holds now (VmRSS), in bytes.
uint64_t resident_bytes();

}  // namespace voxdag
