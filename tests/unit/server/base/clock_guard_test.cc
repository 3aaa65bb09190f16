#include "server/base/clock_guard.h"

#include <gtest/gtest.h>

namespace voxdag::server {
namespace {

constexpr double kDay_s = 86400, kYear_s = 365 * kDay_s;

// A clock that is far ahead is in doubt for a day, whether it was set while the service ran or not.
TEST(ClockGuard, DoubtsAClockThatJumps) {
  ClockGuard running(1e9);
  EXPECT_FALSE(running.has_jumped(1e9 + 100, 50));
  EXPECT_FALSE(running.has_jumped(1e9 + 700, 650));
  EXPECT_FALSE(running.is_in_doubt(650));
  EXPECT_TRUE(running.has_jumped(1e9 + kYear_s, 1250));
  EXPECT_TRUE(running.is_in_doubt(1250));
  EXPECT_FALSE(running.has_jumped(1e9 + kYear_s + 600, 1850)) << "once";
  EXPECT_TRUE(running.is_in_doubt(1250 + kDay_s - 1));
  EXPECT_FALSE(running.is_in_doubt(1250 + kDay_s));
  EXPECT_FALSE(running.has_jumped(1e9, 2450)) << "set right";

  ClockGuard restarted(1e9);
  EXPECT_TRUE(restarted.has_jumped(1e9 + kYear_s, 50));
  EXPECT_TRUE(restarted.is_in_doubt(50));

  ClockGuard fresh(0);
  EXPECT_FALSE(fresh.has_jumped(1e9, 50));
  EXPECT_FALSE(fresh.is_in_doubt(50));
}

}  // namespace
}  // namespace voxdag::server
