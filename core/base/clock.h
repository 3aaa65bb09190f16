// Seconds of wall and CPU time, for reports and measurements; no result depends on them.
#pragma once

#include <time.h>

namespace voxdag {

inline double clock_seconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
// Since an arbitrary start; never set back.
inline double wall_seconds() { return clock_seconds(CLOCK_MONOTONIC); }
// Since 1970-01-01 UTC.
inline double unix_seconds() { return clock_seconds(CLOCK_REALTIME); }
// User and system time of all threads of this process.
inline double process_cpu_seconds() { return clock_seconds(CLOCK_PROCESS_CPUTIME_ID); }
inline double thread_cpu_seconds() { return clock_seconds(CLOCK_THREAD_CPUTIME_ID); }

}  // namespace voxdag
