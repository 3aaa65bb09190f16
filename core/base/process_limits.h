// The memory and CPUs that a build may use on this machine, and the memory that this process uses.
// Two functions also make the C library return freed memory to the system. Without them the process
// would use more memory than is charged to its budget. Thread-safe.
//
// Also turns errors of system calls into codes and messages. If a limit of this process can be the
// cause, the message names the limit and its value.
#pragma once

#include <cstdint>
#include <string>
#include <system_error>

#include "voxdag/error.h"

// VOXDAG_SANITIZED is 1 if the address or thread sanitizer instruments this code, and 0 otherwise.
// Some code and tests need to know this, because sanitizers reserve terabytes of address space,
// retain freed memory and handle signals. g++ defines macros for them; clang has __has_feature.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define VOXDAG_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define VOXDAG_SANITIZED 1
#endif
#endif
#ifndef VOXDAG_SANITIZED
#define VOXDAG_SANITIZED 0
#endif

namespace voxdag {

// The smallest accepted value of --memory, in bytes.
inline constexpr uint64_t kMinMemory = uint64_t{64} << 20;

// Returns the memory that RAM and cgroup limits allow, in bytes.
uint64_t usable_memory();
// Returns half of usable_memory(), but at least kMinMemory, in bytes.
uint64_t default_memory();
// Returns the lowest memory limit, in bytes, of the cgroups in `membership` and of their ancestors.
// `membership` is the text of /proc/self/cgroup. The cgroups are version 1 or 2 and are mounted at
// `mount`. Returns UINT64_MAX if there is no limit.
uint64_t cgroup_memory(const std::string& membership, const std::string& mount);
// Returns the number of CPUs that this process may use: the CPUs of its affinity mask, or fewer if
// a cgroup has a quota.
unsigned default_threads();
// Returns the lowest CPU quota of the cgroups in `membership` and of their ancestors, in CPUs,
// rounded up; the parameters are as for cgroup_memory(). Returns UINT64_MAX if there is no quota.
uint64_t cgroup_cpus(const std::string& membership, const std::string& mount);
// Returns the largest resident set of this process so far (VmHWM), in bytes.
uint64_t peak_resident_bytes();
// Returns the current resident set of this process (VmRSS), in bytes.
uint64_t resident_bytes();
// Returns the maximum number of open files and sockets of this process (RLIMIT_NOFILE).
uint64_t max_open_files();

// Returns the code for a value of errno. A full disk, an exceeded quota and an exceeded limit of
// file sizes are kNoSpace.
ErrorCode code_of_errno(int reason);
// Returns the system's text for a value of errno, and the limits that can cause it: "Too many open
// files (the limit of open files, ulimit -n, is 1024)".
std::string errno_text(int reason);
// Returns the error for a memory allocation that the system refused (std::bad_alloc).
Error out_of_memory_error();
// Returns the Error for an exception of the standard library. The code is kOutOfMemory for EAGAIN,
// with which the system reports that it cannot start another thread.
Error error_of(const std::system_error& error);

// Makes the C library return freed memory to the system immediately, so that resident memory
// follows the charges of a MemoryBudget. Only main() calls this function. A library must not,
// because the setting applies to the complete process of its user. No effect without glibc.
void return_freed_memory_to_system();
// Returns the pages of small freed blocks to the system. The C library retains these pages even
// after return_freed_memory_to_system(). Call trim_heap() after many small blocks were freed. No
// effect if less than 4 MiB are free, or without glibc.
void trim_heap();

}  // namespace voxdag
