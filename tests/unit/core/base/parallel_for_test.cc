// parallel_for_in_order() prepares items concurrently and commits them in order. If an item fails,
// all items before it are committed, and none after it.
#include "core/base/parallel_for.h"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace voxdag {
namespace {

class TurnsTest : public testing::TestWithParam<unsigned> {
 protected:
  static void do_some_work(size_t item) {
    std::mt19937_64 random(item);
    random.discard(random() % 4096);
    if (random() % 8 == 0) std::this_thread::yield();
  }
};

TEST_P(TurnsTest, CommitsInOrder) {
  std::vector<size_t> committed;
  std::vector<size_t> prepared(GetParam());
  parallel_for_in_order(
      GetParam(), 500,
      [&](unsigned worker, size_t item) {
        do_some_work(item);
        prepared[worker] = item;
      },
      [&](unsigned worker, size_t item) {
        EXPECT_EQ(prepared[worker], item);
        committed.push_back(item);
      });
  ASSERT_EQ(committed.size(), 500u);
  for (size_t i = 0; i < committed.size(); ++i) EXPECT_EQ(committed[i], i);
}

TEST_P(TurnsTest, WhatIsBeforeTheFirstFailureIsCommitted) {
  for (size_t round = 0; round < 50; ++round)
    for (const bool in_commit : {false, true}) {
      size_t committed = 0;
      const auto fail = [&](size_t item) {
        if (item == 20 || item == 21 || item == 25) throw std::runtime_error(std::to_string(item));
      };
      try {
        parallel_for_in_order(
            GetParam(), 500,
            [&](unsigned, size_t item) {
              do_some_work(item + round);
              if (!in_commit) fail(item);
            },
            [&](unsigned, size_t item) {
              if (in_commit) fail(item);
              ++committed;
            });
        FAIL();
      } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "20");
      }
      EXPECT_EQ(committed, 20u);
    }
}

INSTANTIATE_TEST_SUITE_P(Threads, TurnsTest, testing::Values(1, 2, 7),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace voxdag
