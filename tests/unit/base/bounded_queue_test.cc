#include "core/base/bounded_queue.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>
#include <vector>

namespace voxdag {
namespace {

// Items arrive once each, in order, however fast either side is.
TEST(BoundedQueue, PassesAllInOrder) {
  constexpr int kItems = 10000;
  BoundedQueue<int, 3> ring;
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

TEST(BoundedQueue, WaitsForAFreeSlot) {
  BoundedQueue<int, 2> ring;
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

TEST(BoundedQueue, ReturnsWhatWasPushedBeforeTheEnd) {
  BoundedQueue<int, 3> ring;
  *ring.free_slot() = 7;
  ring.push();
  ring.end();
  ASSERT_NE(ring.front(), nullptr);
  EXPECT_EQ(*ring.front(), 7);
  ring.pop();
  EXPECT_EQ(ring.front(), nullptr);
}

// A producer that waits for a slot learns that the consumer has stopped.
TEST(BoundedQueue, StopsAWaitingProducer) {
  BoundedQueue<int, 1> ring;
  *ring.free_slot() = 0;
  ring.push();
  std::thread reader([&] { ring.stop(); });
  EXPECT_EQ(ring.free_slot(), nullptr);
  reader.join();
}

class ProducerConsumer : public testing::TestWithParam<unsigned> {
 protected:
  static constexpr int kItems = 1000;

  // Produces items up to kItems and consumes them into taken_; either throws at the item of that
  // number.
  void run(int make_throws_at, int take_throws_at) {
    run_producer_consumer<std::vector<int>, 3>(
        GetParam(),
        [&](auto pass) {
          for (int i = 0; i < kItems; ++i) {
            if (i == make_throws_at) throw std::runtime_error("make");
            pass([&](std::vector<int>& item) {
              item.assign(1, i);
              ++made_;
            });
          }
        },
        [&](const std::vector<int>& item) {
          if (item[0] == take_throws_at) throw std::logic_error("take");
          taken_.push_back(item[0]);
        });
  }
  void expect_taken(int count) {
    ASSERT_EQ(taken_.size(), static_cast<size_t>(count));
    for (int i = 0; i < count; ++i) EXPECT_EQ(taken_[i], i);
  }

  int made_ = 0;
  std::vector<int> taken_;
};

TEST_P(ProducerConsumer, ConsumesAllInOrder) {
  run(-1, -1);
  expect_taken(kItems);
}

TEST_P(ProducerConsumer, ConsumesWhatWasProducedBeforeAFailure) {
  EXPECT_THROW(run(500, -1), std::runtime_error);
  expect_taken(500);
}

TEST_P(ProducerConsumer, ProducesNoMoreOnceConsumingFailed) {
  EXPECT_THROW(run(-1, 500), std::logic_error);
  expect_taken(500);
  EXPECT_LE(made_, 505);
}

// Both fail: what was taken wrongly came first.
TEST_P(ProducerConsumer, ThrowsWhatConsumingThrew) {
  EXPECT_THROW(run(501, 500), std::logic_error);
}

INSTANTIATE_TEST_SUITE_P(Threads, ProducerConsumer, testing::Values(1, 2),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace voxdag
