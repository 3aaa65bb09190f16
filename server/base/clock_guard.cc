#include "server/base/clock_guard.h"

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

constexpr double kMaxStep_s = 3600;
constexpr double kMaxPause_s = kSecondsPerDay;  // in which no service ran
constexpr double kDoubt_s = kSecondsPerDay;

}  // namespace

bool ClockGuard::has_jumped(double clock_s, double now_s) {
  const double expected_s = last_now_s_ < 0 ? kMaxPause_s : now_s - last_now_s_ + kMaxStep_s;
  const bool jumped = last_clock_s_ > 0 && clock_s - last_clock_s_ > expected_s;
  last_clock_s_ = clock_s;
  last_now_s_ = now_s;
  if (jumped) doubt_until_s_ = now_s + kDoubt_s;
  return jumped;
}

double ClockGuard::oldest_s(double days, const char* what, const Log& log) {
  const double clock_s = unix_seconds(), now_s = wall_seconds();
  if (has_jumped(clock_s, now_s))
    log("the clock is far ahead of when the service last saw it: for a day no " +
        std::string(what) + " is deleted for its age");
  return is_in_doubt(now_s) ? 0 : clock_s - days * kSecondsPerDay;
}

}  // namespace voxdag::server
