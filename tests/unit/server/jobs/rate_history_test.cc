#include "server/jobs/rate_history.h"

#include <gtest/gtest.h>

namespace voxdag::server {
namespace {

double units(const RateHistory& history) {
  double sum = 0, begin_s = 0;
  for (const auto& [wall_s, rate] : history.points()) {
    sum += rate * (wall_s - begin_s);
    begin_s = wall_s;
  }
  return sum;
}

TEST(RateHistoryTest, ShowsTheRateOfEachInterval) {
  RateHistory history(50);
  EXPECT_TRUE(history.points().empty());
  EXPECT_EQ(history.rate(), 0);
  history.add(1, 60);
  history.add(2, 90);
  const auto points = history.points();
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].wall_s, 1);
  EXPECT_EQ(points[0].rate, 10);
  EXPECT_EQ(points[1].wall_s, 2);
  EXPECT_EQ(points[1].rate, 30);
  EXPECT_EQ(history.rate(), 30);
}

TEST(RateHistoryTest, JoinsAShortLastInterval) {
  RateHistory history;
  history.add(1, 10);
  history.add(1.25, 20);  // 40 units per second, but for a quarter of a second
  EXPECT_EQ(history.points().size(), 1u);
  EXPECT_EQ(history.rate(), 16);
  history.add(1.75, 40);
  EXPECT_EQ(history.points().size(), 2u);
  EXPECT_EQ(history.rate(), 40);
}

// A stage of a day, with two messages per second: first fast, then slow.
TEST(RateHistoryTest, KeepsTheCompleteStageInBoundedMemory) {
  constexpr int kSeconds = 24 * 3600;
  RateHistory history;
  uint64_t done = 0;
  for (int i = 1; i <= 2 * kSeconds; ++i) {
    done += i <= kSeconds ? 100 : 1;
    history.add(0.5 * i, done);
    ASSERT_LE(history.points().size(), RateHistory::kMaxPoints);
  }
  const auto points = history.points();
  EXPECT_GE(points.size(), RateHistory::kMaxPoints / 2 - 1);
  EXPECT_EQ(points.back().wall_s, kSeconds);
  EXPECT_EQ(points.front().rate, 200);
  EXPECT_EQ(points.back().rate, 2);
  EXPECT_NEAR(units(history), static_cast<double>(done), 1e-3);
}

TEST(RateHistoryTest, IgnoresTimesAndCountsThatGoBack) {
  RateHistory history;
  history.add(2, 10);
  history.add(1, 90);
  history.add(2, 90);
  EXPECT_EQ(history.rate(), 5);
  history.add(4, 3);
  EXPECT_EQ(history.rate(), 0);
}

}  // namespace
}  // namespace voxdag::server
