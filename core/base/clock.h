// Seconds of wall time and CPU time, for reports and measurements. No result depends on them.
#pragma once

#include <time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace voxdag {

inline double clock_seconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
// Returns the seconds since an arbitrary but fixed time. The clock never goes back.
inline double wall_seconds() { return clock_seconds(CLOCK_MONOTONIC); }
// Returns the seconds since 1970-01-01 UTC.
inline double unix_seconds() { return clock_seconds(CLOCK_REALTIME); }
// Returns the user and system time of all threads of this process, in seconds.
inline double process_cpu_seconds() { return clock_seconds(CLOCK_PROCESS_CPUTIME_ID); }
// Returns the user and system time of the calling thread, in seconds.
inline double thread_cpu_seconds() { return clock_seconds(CLOCK_THREAD_CPUTIME_ID); }

// The CPU times of this process's threads, which show whether a stage keeps all threads busy. A
// thread adds its time when its work ends. All threads of parallel_for() with the same worker
// number share one entry, also in different calls. All background threads share one entry.
class ThreadTimes {
 public:
  static constexpr size_t kThreads = 257;  // entries: workers 0 to 255, and background threads
  static constexpr size_t kBackground = kThreads - 1;  // entry of the background threads
  using Seconds = std::array<double, kThreads>;

  // Adds the calling thread's time since its last call to a worker's entry. Call it when the work
  // of the thread ends. Workers above 255 share the entry of worker 255.
  static void add(size_t worker) { add_to(std::min(worker, kBackground - 1)); }
  static void add_background() { add_to(kBackground); }
  // Returns the CPU seconds of each entry so far. Entry 0 also includes the calling thread's time.
  static Seconds now() {
    Seconds seconds;
    for (size_t i = 0; i < kThreads; ++i) seconds[i] = 1e-9 * static_cast<double>(times_ns_[i]);
    seconds[0] += thread_cpu_seconds();
    return seconds;
  }

 private:
  static void add_to(size_t entry) {
    thread_local uint64_t added_ns = 0;
    const auto now_ns = static_cast<uint64_t>(1e9 * thread_cpu_seconds());
    times_ns_[entry] += now_ns - std::exchange(added_ns, now_ns);
  }

  static inline std::array<std::atomic<uint64_t>, kThreads> times_ns_{};
};

}  // namespace voxdag
