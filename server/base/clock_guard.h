// Notices a clock that is far ahead of when the service last saw it: while it may be wrong, nothing
// is deleted for its age. Used by one thread.
#pragma once

#include "server/base/steps.h"

namespace voxdag::server {

inline constexpr double kSecondsPerDay = 86400;

class ClockGuard {
 public:
  // `last_seen_s` is when the last service is known to have run (Unix time), 0 without one.
  explicit ClockGuard(double last_seen_s) : last_clock_s_(last_seen_s) {}

  // True if the clock jumped since the last call. Call it at least once per hour, with the times of
  // unix_seconds() and wall_seconds().
  bool has_jumped(double clock_s, double now_s);
  // True if it did within the last day.
  bool is_uncertain(double now_s) const { return now_s < uncertain_until_s_; }
  // The time (Unix) before which `what`, in the words of a log line, is too old after `days`; 0
  // while the clock is in doubt, which is logged when it begins. Call it instead of has_jumped().
  double oldest_s(double days, const char* what, const Log& log);

 private:
  double last_clock_s_;
  double last_now_s_ = -1;  // of the last call
  double uncertain_until_s_ = 0;
};

}  // namespace voxdag::server
