// Detects a clock that is far ahead of the last time known to the service. While the clock is
// possibly wrong, the service does not delete old data. Used by one thread.
#pragma once

#include "server/base/steps.h"

namespace voxdag::server {

inline constexpr double kSecondsPerDay = 86400;

class ClockGuard {
 public:
  // `last_seen_s` is the latest Unix time at which a previous run of the service was certainly
  // active; 0 if unknown.
  explicit ClockGuard(double last_seen_s) : last_clock_s_(last_seen_s) {}

  // Returns true if, since the last call, `clock_s` has advanced by over an hour more than `now_s`.
  // The first call returns true if `clock_s` is over a day ahead of `last_seen_s`. `clock_s` is the
  // Unix time (unix_seconds()), and `now_s` the time of a clock that nobody sets (wall_seconds()).
  // Call this function at least once per hour.
  bool has_jumped(double clock_s, double now_s);
  // True if the clock jumped within the last day.
  bool is_uncertain(double now_s) const { return now_s < uncertain_until_s_; }
  // Returns the Unix time `days` days ago; 0 while the clock is uncertain, so that no data counts
  // as older than this time. Calls has_jumped(). If the clock has jumped, logs that the service
  // deletes no old data for a day; `what` names the data in this log line.
  double oldest_s(double days, const char* what, const Log& log);

 private:
  double last_clock_s_;
  double last_now_s_ = -1;  // `now_s` of the last call; -1 before the first call
  double uncertain_until_s_ = 0;
};

}  // namespace voxdag::server
