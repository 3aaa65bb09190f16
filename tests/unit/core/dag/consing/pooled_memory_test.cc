#include "core/dag/consing/pooled_memory.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace voxdag {
namespace {

class PooledMemoryTest : public testing::Test {
 protected:
  MemoryBudget budget_{uint64_t{64} << 20};
  PagePool pool_;
  PooledMemory memory_{budget_, pool_};
};

// If zeroed pages are requested, cached pages are zeroed again.
TEST_F(PooledMemoryTest, CachedPagesAreZeroedAgain) {
  for (const size_t size : {1000u, 100000u, 3000000u}) {
    SCOPED_TRACE(size);
    {
      PooledArray<uint8_t> dirty(memory_, size);
      std::fill(dirty.begin(), dirty.end(), 0xff);
    }
    const PooledArray<uint8_t> clean(memory_, size, PooledArray<uint8_t>::kZero);
    EXPECT_TRUE(std::all_of(clean.begin(), clean.end(), [](uint8_t b) { return b == 0; }));
  }
}

// Cached pages are freed if the budget cannot hold both them and an allocation. They take at most
// an eighth of a large budget.
TEST_F(PooledMemoryTest, CachedPagesStayWithinTheBudget) {
  { const PooledArray<uint8_t> used(memory_, 8 << 20); }
  EXPECT_EQ(pool_.cached_bytes(), 8u << 20);
  { const PooledArray<uint8_t> more(memory_, 16 << 20); }
  EXPECT_EQ(pool_.cached_bytes(), 8u << 20);
  {
    const PooledArray<uint8_t> again(memory_, 5 << 20);
    EXPECT_EQ(again.size(), 8u << 20);
    EXPECT_EQ(budget_.used(), 8u << 20);
    EXPECT_EQ(pool_.cached_bytes(), 0u);
  }
  const PooledArray<uint8_t> most(memory_, 60 << 20);
  EXPECT_EQ(pool_.cached_bytes(), 0u);
}

// The oldest cached pages are evicted by newer ones.
TEST_F(PooledMemoryTest, NewPagesEvictOldOnes) {
  for (const size_t mib : {5u, 2u}) {
    const PooledArray<uint8_t> used(memory_, mib << 20);
  }
  EXPECT_EQ(pool_.cached_bytes(), 8u << 20);
  { const PooledArray<uint8_t> zeroed(memory_, 4 << 20, PooledArray<uint8_t>::kZero); }
  EXPECT_EQ(pool_.cached_bytes(), 6u << 20);
  EXPECT_EQ(pool_.take(5 << 20, 5 << 20).data, nullptr);
}

// Large ranges are multiples of huge pages. Only such ranges keep their huge pages when they grow.
TEST_F(PooledMemoryTest, LargeRangesAreMultiplesOfHugePages) {
  EXPECT_EQ(PagePool::range_bytes(1), 4096u);
  EXPECT_EQ(PagePool::range_bytes((4 << 20) - 1), 4u << 20);
  EXPECT_EQ(PagePool::range_bytes((4 << 20) + 1), 6u << 20);
  EXPECT_EQ(PagePool::range_bytes(6 << 20), 6u << 20);
}

// A zeroed array has exactly the requested size: the hash tables rely on that.
TEST_F(PooledMemoryTest, ZeroedArraysAreExact) {
  { const PooledArray<uint8_t> used(memory_, 8 << 20); }
  const PooledArray<uint8_t> table(memory_, 4 << 20, PooledArray<uint8_t>::kZero);
  EXPECT_EQ(table.size(), 4u << 20);
}

// Growing keeps the contents, both on cached and on new pages, and charges the array's size.
TEST_F(PooledMemoryTest, ArraysGrow) {
  PooledArray<uint32_t> array(memory_, 10);
  uint32_t filled = 0;
  while (array.size() < 6000000) {
    for (; filled < array.size(); ++filled) array[filled] = filled * 2654435761u;
    array.grow(memory_, array.size() + 1);
    ASSERT_EQ(budget_.used(), array.size() * sizeof(uint32_t));
    for (uint32_t i = 0; i < filled; i += 97) ASSERT_EQ(array[i], i * 2654435761u);
  }
}

// Arrays grow into cached pages. So the cache does not get another range each time that an array
// grows to the same size.
TEST_F(PooledMemoryTest, ArraysGrowIntoCachedPages) {
  constexpr size_t kBytes = 1 << 20;
  const auto use = [&] {
    PooledArray<uint8_t> array(memory_, 10);
    while (array.size() < kBytes) {
      const size_t filled = array.size();
      std::fill(array.begin(), array.end(), static_cast<uint8_t>(filled >> 12));
      array.grow(memory_, filled + 1);
      ASSERT_EQ(budget_.used(), array.size());
      ASSERT_EQ(array[0], static_cast<uint8_t>(filled >> 12));
      ASSERT_EQ(array[filled - 1], static_cast<uint8_t>(filled >> 12));
    }
  };
  for (int i = 0; i < 20; ++i) use();
  EXPECT_LT(pool_.cached_bytes(), 3 * kBytes);
  EXPECT_EQ(budget_.used(), 0u);
}

// If the budget has no space for an array's old pages together with cached ones, the array grows
// without the cached pages.
TEST_F(PooledMemoryTest, ArraysGrowInPlaceIfTheBudgetIsTight) {
  PooledArray<uint8_t> array(memory_, 6 << 20);
  array[(6 << 20) - 1] = 42;
  { const PooledArray<uint8_t> freed(memory_, 8 << 20); }
  ASSERT_EQ(pool_.cached_bytes(), 8u << 20);
  ASSERT_TRUE(budget_.try_charge(52 << 20));
  array.grow(memory_, 7 << 20);
  EXPECT_EQ(array.size(), 8u << 20);
  EXPECT_EQ(array[(6 << 20) - 1], 42);
  EXPECT_EQ(pool_.cached_bytes(), 0u);
  EXPECT_EQ(budget_.used(), 60u << 20);
  budget_.release(52 << 20);
}

// An array that does not fit throws OutOfBudget. If an array cannot grow, it is unchanged.
TEST_F(PooledMemoryTest, TooLargeIsOutOfBudget) {
  EXPECT_THROW(PooledArray<uint64_t>(memory_, 9 << 20), OutOfBudget);
  PooledArray<uint64_t> array(memory_, 6 << 20);
  array[0] = 42;
  const uint64_t used = budget_.used();
  EXPECT_THROW(array.grow(memory_, 9 << 20), OutOfBudget);
  EXPECT_EQ(budget_.used(), used);
  EXPECT_EQ(array[0], 42u);
  array = {};
  EXPECT_EQ(budget_.used(), 0u);
}

}  // namespace
}  // namespace voxdag
