#include "core/base/memory_budget.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <thread>
#include <vector>

#include "core/base/error.h"

namespace voxdag {
namespace {

// A charge that fits is recorded. A charge that does not fit changes nothing. A charge up to the
// limit itself fits.
TEST(MemoryBudget, ChargesUpToItsLimit) {
  MemoryBudget budget(100);
  EXPECT_TRUE(budget.try_charge(60));
  EXPECT_FALSE(budget.try_charge(41));
  EXPECT_EQ(budget.used(), 60u);
  EXPECT_EQ(budget.available(), 40u);
  EXPECT_TRUE(budget.try_charge(40));
  EXPECT_TRUE(budget.try_charge(0));
  EXPECT_EQ(budget.available(), 0u);
  budget.release(100);
  EXPECT_EQ(budget.used(), 0u);
  EXPECT_EQ(budget.peak(), 100u);
}

// Sizes near 2^64 must not wrap around to a small sum that fits.
TEST(MemoryBudget, RefusesSizesThatWouldWrap) {
  MemoryBudget budget(100);
  ASSERT_TRUE(budget.try_charge(50));
  EXPECT_FALSE(budget.try_charge(UINT64_MAX));
  EXPECT_FALSE(budget.try_charge(UINT64_MAX - 49));
  EXPECT_EQ(budget.used(), 50u);
  MemoryBudget endless(UINT64_MAX);
  ASSERT_TRUE(endless.try_charge(UINT64_MAX - 1));
  EXPECT_FALSE(endless.try_charge(2));
}

// The error names the buffer, its size, the free memory and the limit.
TEST(MemoryBudget, NamesWhatDidNotFit) {
  MemoryBudget budget(1000);
  budget.charge(300, "the first");
  try {
    budget.charge(701, "the node table");
    FAIL() << "charged beyond the limit";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
    for (const char* part : {"the node table", "701", "700", "1000"})
      EXPECT_NE(error.message().find(part), std::string::npos) << error.message();
  }
  EXPECT_EQ(budget.used(), 300u);
}

// A budget with a parent is a share of the parent. Charging a share also charges its parent, and
// the parent's parent. If one of them has no room, no charge remains.
TEST(MemoryBudget, SharesChargeTheirParents) {
  MemoryBudget whole(100);
  MemoryBudget half(50, &whole);
  MemoryBudget part(80, &half);
  EXPECT_EQ(part.available(), 50u);
  EXPECT_TRUE(part.try_charge(30));
  EXPECT_EQ(half.used(), 30u);
  EXPECT_EQ(whole.used(), 30u);
  EXPECT_FALSE(part.try_charge(21));
  EXPECT_EQ(part.used(), 30u);
  EXPECT_EQ(half.used(), 30u);
  ASSERT_TRUE(whole.try_charge(65));
  EXPECT_EQ(part.available(), 5u);
  EXPECT_FALSE(part.try_charge(6));
  EXPECT_EQ(half.used(), 30u);
  part.release(30);
  EXPECT_EQ(half.used(), 0u);
  EXPECT_EQ(whole.used(), 65u);
}

// A MemoryCharge can be moved, resized and overwritten. Its bytes are released exactly once.
TEST(MemoryCharge, IsReleasedOnce) {
  MemoryBudget budget(100);
  {
    MemoryCharge a(budget, 40, "a");
    MemoryCharge b(std::move(a));
    EXPECT_EQ(b.bytes(), 40u);
    EXPECT_EQ(budget.used(), 40u);
    EXPECT_TRUE(b.try_resize(90));
    EXPECT_FALSE(b.try_resize(101));
    EXPECT_EQ(b.bytes(), 90u);
    EXPECT_TRUE(b.try_resize(10));
    EXPECT_EQ(budget.used(), 10u);
    MemoryCharge c(budget, 20, "c");
    c = std::move(b);
    EXPECT_EQ(budget.used(), 10u);
    EXPECT_THROW(MemoryCharge(budget, 91, "d"), Error);
  }
  EXPECT_EQ(budget.used(), 0u);
}

// A charge without a budget charges nothing and cannot grow.
TEST(MemoryCharge, WithoutBudgetHoldsNothing) {
  MemoryCharge none;
  EXPECT_TRUE(none.try_resize(0));
  EXPECT_FALSE(none.try_resize(1));
  EXPECT_EQ(none.bytes(), 0u);
}

// Many threads charge shares of one budget. The limit is never exceeded, and everything is released
// at the end.
TEST(MemoryBudget, IsNotExceededByThreads) {
  constexpr uint64_t kLimit = 1000;
  MemoryBudget whole(kLimit);
  std::atomic<bool> over{false};
  const auto work = [&](uint64_t seed, MemoryBudget& share) {
    std::mt19937_64 random(seed);
    for (int i = 0; i < 20000; ++i) {
      const uint64_t bytes = random() % 500;
      if (!share.try_charge(bytes)) continue;
      if (whole.used() > kLimit || share.used() > share.limit()) over = true;
      share.release(bytes);
    }
  };
  MemoryBudget left(700, &whole), right(700, &whole);
  std::vector<std::thread> threads;
  for (uint64_t t = 0; t < 4; ++t) threads.emplace_back([&, t] { work(t, t % 2 ? left : right); });
  for (std::thread& t : threads) t.join();
  EXPECT_FALSE(over);
  EXPECT_LE(whole.peak(), kLimit);
  EXPECT_LE(left.peak(), left.limit());
  EXPECT_GT(whole.peak(), 0u);
  EXPECT_EQ(whole.used(), 0u);
  EXPECT_EQ(left.used(), 0u);
}

}  // namespace
}  // namespace voxdag
