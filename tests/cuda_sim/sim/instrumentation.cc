// The backend's sources are compiled with -fsanitize=thread, so the compiler inserts a function
// call before each memory access. This file defines the called functions; the sanitizer's own
// library is not linked. While a kernel runs, the functions check the accesses of its
// threads. While the host runs, they check that it does not access device memory.
#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "tests/cuda_sim/sim/device_memory.h"
#include "tests/cuda_sim/sim/shared_memory.h"
#include "tests/cuda_sim/sim/thread_blocks.h"
#include "tests/cuda_sim/sim/violation.h"

extern "C" char __executable_start, __data_start;

namespace voxdag::cuda_sim {
namespace {

// True if a kernel's thread may access `p` without further checks. This holds for its own variables
// on the stack of its fiber, the arguments of the launch, and, for reads, constants of the program.
bool is_private(const void* p, Access access) {
  const char* at = static_cast<const char*>(p);
  const char* arguments = static_cast<const char*>(g_running.launch->arguments);
  return on_fiber_stack(p) ||
         (at >= arguments && at < arguments + g_running.launch->argument_bytes) ||
         (access == Access::kRead && at >= &__executable_start && at < &__data_start);
}

void check(void* p, size_t bytes, Access access, bool is_range) {
  const RunningThread& now = g_running;
  DeviceMemory& memory = device_memory();
  const size_t alignment = std::min(bytes, sizeof(uint64_t));
  if ((memory.contains(p) || in_shared_memory(p)) && !is_range && std::has_single_bit(alignment) &&
      reinterpret_cast<uintptr_t>(p) % alignment != 0)
    violation("a misaligned access of " + std::to_string(bytes) + " bytes");
  if (memory.contains(p)) {
    if (access == Access::kRead)
      memory.kernel_read(p, bytes, now.first, now.number);
    else
      memory.kernel_write(p, bytes, now.first, now.number);
  } else if (in_shared_memory(p)) {
    shared_access(p, bytes, access, now.thread);
  } else if (!is_private(p, access)) {
    violation("a kernel touches memory of the host");
  }
}

// Suspends the checks while the simulation itself runs, because inline functions that it shares
// with the backend's sources are instrumented.
class Unwatched {
 public:
  Unwatched() { g_running.running = false; }
  ~Unwatched() { g_running.running = true; }
  Unwatched(const Unwatched&) = delete;
};

inline void on_access(void* p, size_t bytes, Access access, bool is_range = false) {
  if (g_running.running) {
    const Unwatched unwatched;
    check(p, bytes, access, is_range);
  } else if (device_memory().contains(p) && !device_memory().is_open()) {
    violation("the host touches device memory outside of a copy");
  }
}

}  // namespace

void atomic_access(void* p, size_t bytes) {
  const Unwatched unwatched;
  const RunningThread& now = g_running;
  if (device_memory().contains(p))
    device_memory().kernel_atomic(p, bytes, now.first);
  else if (in_shared_memory(p))
    shared_access(p, bytes, Access::kAtomic, now.thread);
  else
    violation("a kernel touches memory of the host by an atomic");
}

}  // namespace voxdag::cuda_sim

using voxdag::cuda_sim::Access;
using voxdag::cuda_sim::on_access;

#define VOXDAG_ACCESS(bytes)                                                         \
  void __tsan_read##bytes(void* p) { on_access(p, bytes, Access::kRead); }           \
  void __tsan_write##bytes(void* p) { on_access(p, bytes, Access::kWrite); }         \
  void __tsan_unaligned_read##bytes(void* p) { on_access(p, bytes, Access::kRead); } \
  void __tsan_unaligned_write##bytes(void* p) { on_access(p, bytes, Access::kWrite); }

// Atomic operations of the backend's host code: the compiler replaces them by calls of these
// functions.
#define VOXDAG_ATOMIC(bits, T)                                 \
  T __tsan_atomic##bits##_load(const volatile T* p, int) {     \
    return __atomic_load_n(p, __ATOMIC_SEQ_CST);               \
  }                                                            \
  void __tsan_atomic##bits##_store(volatile T* p, T v, int) {  \
    __atomic_store_n(p, v, __ATOMIC_SEQ_CST);                  \
  }                                                            \
  T __tsan_atomic##bits##_fetch_add(volatile T* p, T v, int) { \
    return __atomic_fetch_add(p, v, __ATOMIC_SEQ_CST);         \
  }                                                            \
  T __tsan_atomic##bits##_fetch_sub(volatile T* p, T v, int) { \
    return __atomic_fetch_sub(p, v, __ATOMIC_SEQ_CST);         \
  }

extern "C" {

VOXDAG_ACCESS(1)
VOXDAG_ACCESS(2)
VOXDAG_ACCESS(4)
VOXDAG_ACCESS(8)
VOXDAG_ACCESS(16)
VOXDAG_ATOMIC(8, uint8_t)
VOXDAG_ATOMIC(32, uint32_t)
VOXDAG_ATOMIC(64, uint64_t)

void __tsan_init() {}
void __tsan_func_entry(void*) {}
void __tsan_func_exit() {}
void __tsan_vptr_read(void**) {}
void __tsan_vptr_update(void**, void*) {}
void __tsan_read_range(void* p, size_t bytes) { on_access(p, bytes, Access::kRead, true); }
void __tsan_write_range(void* p, size_t bytes) { on_access(p, bytes, Access::kWrite, true); }
// Clang inserts calls of these functions for copies of structures.
void* __tsan_memcpy(void* to, const void* from, size_t bytes) {
  on_access(const_cast<void*>(from), bytes, Access::kRead, true);
  on_access(to, bytes, Access::kWrite, true);
  return std::memcpy(to, from, bytes);
}
void* __tsan_memmove(void* to, const void* from, size_t bytes) {
  on_access(const_cast<void*>(from), bytes, Access::kRead, true);
  on_access(to, bytes, Access::kWrite, true);
  return std::memmove(to, from, bytes);
}
void* __tsan_memset(void* to, int value, size_t bytes) {
  on_access(to, bytes, Access::kWrite, true);
  return std::memset(to, value, bytes);
}

}  // extern "C"
