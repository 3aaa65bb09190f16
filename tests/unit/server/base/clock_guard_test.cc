#include "server/base/clock_guard.h"

#include <gtest/gtest.h>

namespace voxdag::server {
namespace {

constexpr double kDayS = 86400, kYearS = 365 * kDayS;

// After a clock has jumped far ahead, it is not trusted for a day, whether it jumped while the
// service ran or before.
TEST(ClockGuard, DoubtsAClockThatJumps) {
  ClockGuard running(1e9);
  EXPECT_FALSE(running.has_jumped(1e9 + 100, 50));
  EXPECT_FALSE(running.has_jumped(1e9 + 700, 650));
  EXPECT_FALSE(running.is_uncertain(650));
  EXPECT_TRUE(running.has_jumped(1e9 + kYearS, 1250));
  EXPECT_TRUE(running.is_uncertain(1250));
  EXPECT_FALSE(running.has_jumped(1e9 + kYearS + 600, 1850)) << "once";
  EXPECT_TRUE(running.is_uncertain(1250 + kDayS - 1));
  EXPECT_FALSE(running.is_uncertain(1250 + kDayS));
  EXPECT_FALSE(running.has_jumped(1e9, 2450)) << "set right";

  ClockGuard restarted(1e9);
  EXPECT_TRUE(restarted.has_jumped(1e9 + kYearS, 50));
  EXPECT_TRUE(restarted.is_uncertain(50));

  ClockGuard fresh(0);
  EXPECT_FALSE(fresh.has_jumped(1e9, 50));
  EXPECT_FALSE(fresh.is_uncertain(50));
}

}  // namespace
}  // namespace voxdag::server
