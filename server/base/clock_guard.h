// Detects a clock that is far ahead of the last time known to the service. While the clock may be
// wrong, nothing is deleted because of its age. Used by one thread.
#pragma once

#include "server/base/steps.h"

namespace voxdag::server {

inline constexpr double kSecondsPerDay = 86400;

class ClockGuard {
 public:
  // `last_seen_s`: Unix time at which the previous service is known to have run; 0 if unknown.
  explicit ClockGuard(double last_seen_s) : last_clock_s_(last_seen_s) {}

  // True if the clock jumped since the last call. Call it at least once per hour, with the times of
  // unix_seconds() and wall_seconds().
  bool has_jumped(double clock_s, double now_s);
  // True if the clock jumped within the last day.
  bool is_uncertain(double now_s) const { return now_s < uncertain_until_s_; }
  // Returns the Unix time before which data is older than `days`; 0 while the clock is uncertain.
  // Logs the begin of this state, with `what` in the log line. Call it instead of has_jumped().
  double oldest_s(double days, const char* what, const Log& log);

 private:
  double last_clock_s_;
  double last_now_s_ = -1;  // time of the last call
  double uncertain_until_s_ = 0;
};

}  // namespace voxdag::server
