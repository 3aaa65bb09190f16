// Seconds of wall time and CPU time, for reports and measurements. No result depends on them.
#pragma once

#include <time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace voxdag {

inline double clock_seconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
// Returns the seconds since an arbitrary start. The time never goes back.
inline double wall_seconds() { return clock_seconds(CLOCK_MONOTONIC); }
// Returns the seconds since 1970-01-01 UTC.
inline double unix_seconds() { return clock_seconds(CLOCK_REALTIME); }
// Returns the user and system time of all threads of this process, in seconds.
inline double process_cpu_seconds() { return clock_seconds(CLOCK_PROCESS_CPUTIME_ID); }
inline double thread_cpu_seconds() { return clock_seconds(CLOCK_THREAD_CPUTIME_ID); }

// CPU time of each thread, which shows whether a stage keeps all threads busy. The times of all
// threads that parallel_for() started with the same worker number are added together. So are the
// times of all background threads. A thread adds its time when it ends.
class ThreadTimes {
 public:
  static constexpr size_t kThreads = 257;
  static constexpr size_t kBackground = kThreads - 1;
  using Seconds = std::array<double, kThreads>;

  // Adds the time of the ending thread to a worker's time. All workers from 255 share one entry.
  static void add(size_t worker) { times_ns_[std::min(worker, kBackground - 1)] += now_ns(); }
  static void add_background() { times_ns_[kBackground] += now_ns(); }
  // Returns the times so far. The calling thread's time counts as worker 0's.
  static Seconds now() {
    Seconds seconds;
    for (size_t i = 0; i < kThreads; ++i) seconds[i] = 1e-9 * static_cast<double>(times_ns_[i]);
    seconds[0] += thread_cpu_seconds();
    return seconds;
  }

 private:
  static uint64_t now_ns() { return static_cast<uint64_t>(1e9 * thread_cpu_seconds()); }

  static inline std::array<std::atomic<uint64_t>, kThreads> times_ns_{};
};

}  // namespace voxdag
