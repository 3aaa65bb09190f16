#include "core/backend/cpu/memory.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace voxdag::cpu {
namespace {

class CpuMemory : public testing::Test {
 protected:
  MemoryBudget budget_{uint64_t{64} << 20};
  PagePool pool_;
  Memory memory_{budget_, pool_};
};

// A block that was used before is handed out zero where zero was asked for.
TEST_F(CpuMemory, KeptPagesAreZeroedAgain) {
  for (const size_t size : {1000u, 100000u, 3000000u}) {
    SCOPED_TRACE(size);
    {
      Buffer<uint8_t> dirty(memory_, size);
      std::fill(dirty.begin(), dirty.end(), 0xff);
    }
    const Buffer<uint8_t> clean(memory_, size, Buffer<uint8_t>::kZero);
    EXPECT_TRUE(std::all_of(clean.begin(), clean.end(), [](uint8_t b) { return b == 0; }));
  }
}

// Pages that are kept make way for what the budget could not hold beside them, and are no more than
// an eighth of a large budget.
TEST_F(CpuMemory, KeptPagesStayWithinTheBudget) {
  { const Buffer<uint8_t> used(memory_, 7 << 20); }
  EXPECT_EQ(pool_.kept_bytes(), 7u << 20);
  { const Buffer<uint8_t> more(memory_, 16 << 20); }
  EXPECT_EQ(pool_.kept_bytes(), 7u << 20);
  {
    const Buffer<uint8_t> again(memory_, 5 << 20);
    EXPECT_EQ(again.size(), 7u << 20);
    EXPECT_EQ(budget_.used(), 7u << 20);
    EXPECT_EQ(pool_.kept_bytes(), 0u);
  }
  const Buffer<uint8_t> most(memory_, 60 << 20);
  EXPECT_EQ(pool_.kept_bytes(), 0u);
}

// Of what was kept the oldest makes way for the newest.
TEST_F(CpuMemory, OldPagesMakeWayForNew) {
  for (const size_t mib : {5u, 2u}) {
    const Buffer<uint8_t> used(memory_, mib << 20);
  }
  EXPECT_EQ(pool_.kept_bytes(), 7u << 20);
  { const Buffer<uint8_t> zeroed(memory_, 4 << 20, Buffer<uint8_t>::kZero); }
  EXPECT_EQ(pool_.kept_bytes(), 6u << 20);
  EXPECT_EQ(pool_.take_kept(5 << 20, 5 << 20).pages, nullptr);
}

// What must be zero is as large as was asked for: tables rely on that.
TEST_F(CpuMemory, ZeroedBlocksAreExact) {
  { const Buffer<uint8_t> used(memory_, 7 << 20); }
  const Buffer<uint8_t> table(memory_, 4 << 20, Buffer<uint8_t>::kZero);
  EXPECT_EQ(table.size(), 4u << 20);
}

// Growing keeps the contents, within kept sizes and beyond, and charges what the buffer has.
TEST_F(CpuMemory, BuffersGrow) {
  Buffer<uint32_t> buffer(memory_, 10);
  uint32_t filled = 0;
  while (buffer.size() < 6000000) {
    for (; filled < buffer.size(); ++filled) buffer[filled] = filled * 2654435761u;
    buffer.grow(memory_, buffer.size() + 1);
    ASSERT_EQ(budget_.used(), buffer.size() * sizeof(uint32_t));
    for (uint32_t i = 0; i < filled; i += 97) ASSERT_EQ(buffer[i], i * 2654435761u);
  }
}

// What does not fit is Outgrown; the buffer that would not grow is as it was.
TEST_F(CpuMemory, TooLargeIsOutgrown) {
  EXPECT_THROW(Buffer<uint64_t>(memory_, 9 << 20), Outgrown);
  Buffer<uint64_t> buffer(memory_, 6 << 20);
  buffer[0] = 42;
  const uint64_t used = budget_.used();
  EXPECT_THROW(buffer.grow(memory_, 9 << 20), Outgrown);
  EXPECT_EQ(budget_.used(), used);
  EXPECT_EQ(buffer[0], 42u);
  buffer = {};
  EXPECT_EQ(budget_.used(), 0u);
}

}  // namespace
}  // namespace voxdag::cpu
