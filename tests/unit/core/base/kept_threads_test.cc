#include "core/base/threads/kept_threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <set>
#include <thread>

#include "core/base/parallel_for.h"

namespace voxdag {
namespace {

// Returns the ids of the threads that run the items of a parallel_for(). Each thread runs one item,
// because an item waits until all items have begun.
std::set<std::thread::id> threads_of(unsigned workers) {
  std::mutex mutex;
  std::set<std::thread::id> ids;
  std::atomic<unsigned> begun = 0;
  parallel_for(workers, workers, [&](unsigned, size_t) {
    ++begun;
    while (begun < workers) std::this_thread::yield();
    const std::lock_guard lock(mutex);
    ids.insert(std::this_thread::get_id());
  });
  return ids;
}

TEST(KeptThreads, LoopsUseTheSameThreads) {
  const KeptThreads threads;
  const auto first = threads_of(4);
  EXPECT_EQ(first.size(), 4u);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(threads_of(4), first);
  const auto more = threads_of(6);
  EXPECT_EQ(more.size(), 6u);
  for (const std::thread::id& id : first) EXPECT_TRUE(more.contains(id));
}

TEST(KeptThreads, NestedLoopsRunConcurrently) {
  const KeptThreads threads;
  std::atomic<size_t> inner = 0;
  parallel_for(3, 3, [&](unsigned, size_t) {
    const KeptThreads of_worker;
    inner += threads_of(2).size() + threads_of(3).size();
  });
  EXPECT_EQ(inner, 15u);
}

TEST(KeptThreads, OtherThreadsDoNotUseThem) {
  const KeptThreads threads;
  const std::set<std::thread::id> kept = threads_of(3);
  std::set<std::thread::id> others;
  std::thread([&] { others = threads_of(3); }).join();
  EXPECT_EQ(others.size(), 3u);
  for (const std::thread::id& id : others) EXPECT_FALSE(kept.contains(id));
}

}  // namespace
}  // namespace voxdag
