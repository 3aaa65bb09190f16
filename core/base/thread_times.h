// CPU time by threads, to see whether a stage keeps all of them busy. The threads that
// parallel_for() starts one after the other for the same worker count as one; so do all that run in
// the background. A thread adds its time when it ends.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "core/base/clock.h"

namespace voxdag {

class ThreadTimes {
 public:
  static constexpr size_t kThreads = 257;
  static constexpr size_t kBackground = kThreads - 1;
  using Seconds = std::array<double, kThreads>;

  // Adds the time of this thread, which ends, to that of a worker; workers above 255 share a place.
  static void add(size_t worker) { times_ns_[std::min(worker, kBackground - 1)] += now_ns(); }
  static void add_background() { times_ns_[kBackground] += now_ns(); }
  // The times so far. That of this thread is taken for that of worker 0, whose part it has.
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
