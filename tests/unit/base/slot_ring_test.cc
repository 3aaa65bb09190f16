#include "core/base/slot_ring.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace voxdag {
namespace {

// Items arrive once each, in order, however fast either side is.
TEST(SlotRing, PassesAllInOrder) {
  constexpr int kItems = 10000;
  SlotRing<int, 3> ring;
  std::thread writer([&] {
    for (int i = 0; i < kItems; ++i) {
      *ring.free_slot() = i;
      ring.push();
    }
    ring.end();
  });
  std::vector<int> got;
  for (; const int* item = ring.front(); ring.pop()) got.push_back(*item);
  writer.join();
  ASSERT_EQ(got.size(), size_t{kItems});
  for (int i = 0; i < kItems; ++i) ASSERT_EQ(got[i], i);
}

TEST(SlotRing, WaitsForAFreeSlot) {
  SlotRing<int, 2> ring;
  for (int i = 0; i < 2; ++i) {
    *ring.free_slot() = i;
    ring.push();
  }
  std::thread reader([&] { ring.pop(); });
  *ring.free_slot() = 2;  // not before the first item went
  ring.push();
  reader.join();
  EXPECT_EQ(*ring.front(), 1);
}

TEST(SlotRing, GivesWhatWasPushedBeforeTheEnd) {
  SlotRing<int, 3> ring;
  *ring.free_slot() = 7;
  ring.push();
  ring.end();
  ASSERT_NE(ring.front(), nullptr);
  EXPECT_EQ(*ring.front(), 7);
  ring.pop();
  EXPECT_EQ(ring.front(), nullptr);
}

// A writer that waits learns that nobody reads any more.
TEST(SlotRing, TellsThatTheReaderGaveUp) {
  SlotRing<int, 1> ring;
  *ring.free_slot() = 0;
  ring.push();
  std::thread reader([&] { ring.give_up(); });
  EXPECT_EQ(ring.free_slot(), nullptr);
  reader.join();
}

}  // namespace
}  // namespace voxdag
