#include "server/base/clock_guard.h"

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

// The clock has jumped if, between two calls, it advances by over kMaxStepS more than the elapsed
// time.
constexpr double kMaxStepS = 3600;
// The clock has jumped if it is over kMaxPauseS ahead of the end of the previous run of the
// service.
constexpr double kMaxPauseS = kSecondsPerDay;
constexpr double kUncertainS = kSecondsPerDay;  // time after a jump in which nothing is deleted

}  // namespace

bool ClockGuard::has_jumped(double clock_s, double now_s) {
  const double expected_s = last_now_s_ < 0 ? kMaxPauseS : now_s - last_now_s_ + kMaxStepS;
  const bool jumped = last_clock_s_ > 0 && clock_s - last_clock_s_ > expected_s;
  last_clock_s_ = clock_s;
  last_now_s_ = now_s;
  if (jumped) uncertain_until_s_ = now_s + kUncertainS;
  return jumped;
}

double ClockGuard::oldest_s(double days, const char* what, const Log& log) {
  const double clock_s = unix_seconds(), now_s = wall_seconds();
  if (has_jumped(clock_s, now_s))
    log({"the clock is far ahead of the time last seen by the service: for a day no " +
             std::string(what) + " is deleted because of its age",
         LogLevel::kWarning});
  return is_uncertain(now_s) ? 0 : clock_s - days * kSecondsPerDay;
}

}  // namespace voxdag::server
