#include "server/clock_guard.h"

namespace voxdag::server {
namespace {

constexpr double kMaxStep_s = 3600;
constexpr double kMaxPause_s = 86400;  // in which no service ran
constexpr double kDoubt_s = 86400;

}  // namespace

bool ClockGuard::has_jumped(double clock_s, double now_s) {
  const double expected_s = last_now_s_ < 0 ? kMaxPause_s : now_s - last_now_s_ + kMaxStep_s;
  const bool jumped = last_clock_s_ > 0 && clock_s - last_clock_s_ > expected_s;
  last_clock_s_ = clock_s;
  last_now_s_ = now_s;
  if (jumped) doubt_until_s_ = now_s + kDoubt_s;
  return jumped;
}

}  // namespace voxdag::server
