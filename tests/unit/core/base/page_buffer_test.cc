#include "core/base/page_buffer.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/base/error.h"

namespace voxdag {
namespace {

// Pages are zero-filled, even after a buffer with other contents was freed.
TEST(PageBuffer, IsZeroFilled) {
  MemoryBudget budget(uint64_t{64} << 20);
  for (int round = 0; round < 3; ++round) {
    PageBuffer<uint64_t> buffer(budget, (20 << 20) / 8, "test");
    EXPECT_TRUE(std::all_of(buffer.begin(), buffer.end(), [](uint64_t x) { return x == 0; }));
    std::fill(buffer.begin(), buffer.end(), ~uint64_t{0});
  }
}

// Bytes are charged once, from allocation to release, even if the buffer is moved.
TEST(PageBuffer, ChargesWhatItHolds) {
  MemoryBudget budget(10000);
  {
    PageBuffer<uint32_t> a(budget, 1000, "a");
    EXPECT_EQ(budget.used(), 4000u);
    a[999] = 7;
    PageBuffer<uint32_t> b(std::move(a));
    EXPECT_EQ(a.size(), 0u);
    EXPECT_EQ(b[999], 7u);
    EXPECT_EQ(budget.used(), 4000u);
    PageBuffer<uint32_t> c(budget, 500, "c");
    c = std::move(b);
    EXPECT_EQ(c.size(), 1000u);
    EXPECT_EQ(c[999], 7u);
    EXPECT_EQ(budget.used(), 4000u);
    c = PageBuffer<uint32_t>();
    EXPECT_EQ(budget.used(), 0u);
  }
  EXPECT_EQ(budget.used(), 0u);
}

// Growing keeps the contents, zero-fills the added part and charges it. A failed growth changes
// nothing.
TEST(PageBuffer, Grows) {
  MemoryBudget budget(uint64_t{1} << 20);
  PageBuffer<uint32_t> buffer(budget, 1000, "table");
  for (uint32_t i = 0; i < 1000; ++i) buffer[i] = i + 1;
  buffer.grow(100000, "table");
  EXPECT_EQ(buffer.size(), 100000u);
  EXPECT_EQ(budget.used(), 400000u);
  for (uint32_t i = 0; i < 100000; ++i) ASSERT_EQ(buffer[i], i < 1000 ? i + 1 : 0);
  for (const size_t size : {size_t{1} << 20, (size_t{1} << 62) + 100000}) {
    try {
      buffer.grow(size, "the brick table");
      ADD_FAILURE() << "grew to " << size;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
      EXPECT_NE(error.message().find("the brick table"), std::string::npos) << error.message();
    }
    EXPECT_EQ(buffer.size(), 100000u);
    EXPECT_EQ(buffer[999], 1000u);
    EXPECT_EQ(budget.used(), 400000u);
  }
}

// Small and large buffers have different allocators; a buffer that grows changes from one to the
// other.
TEST(PageBuffer, GrowsAcrossAllocators) {
  MemoryBudget budget(uint64_t{1} << 20);
  PageBuffer<uint32_t> buffer(budget, 3, "numbers");
  for (uint32_t i = 0; i < 3; ++i) buffer[i] = i + 1;
  for (size_t size = 9; size < (size_t{1} << 17); size *= 3) {
    buffer.grow(size, "numbers");
    EXPECT_EQ(reinterpret_cast<uintptr_t>(buffer.data()) % 64, 0u);
    for (size_t i = 0; i < size; ++i) ASSERT_EQ(buffer[i], i < size / 3 ? i + 1 : 0) << size;
    for (size_t i = 0; i < size; ++i) buffer[i] = static_cast<uint32_t>(i) + 1;
  }
}

// An empty buffer costs nothing.
TEST(PageBuffer, MayBeEmpty) {
  MemoryBudget budget(0);
  PageBuffer<uint32_t> buffer(budget, 0, "nothing");
  EXPECT_EQ(buffer.begin(), buffer.end());
}

// An allocation fails if it exceeds the budget, if the system refuses it, or if its size in bytes
// exceeds 64 bits. The error is kOutOfMemory and names the buffer, and nothing remains charged.
TEST(PageBuffer, NamesWhatDidNotFit) {
  MemoryBudget small(4096), endless(UINT64_MAX);
  const auto refused = [](MemoryBudget& budget, size_t size) {
    try {
      PageBuffer<uint64_t> buffer(budget, size, "the brick table");
      ADD_FAILURE() << size << " words were handed out";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
      EXPECT_NE(error.message().find("the brick table"), std::string::npos) << error.message();
    }
    EXPECT_EQ(budget.used(), 0u);
  };
  refused(small, 513);
  refused(endless, size_t{1} << 58);
  refused(endless, (size_t{1} << 61) + 1);
}

}  // namespace
}  // namespace voxdag
