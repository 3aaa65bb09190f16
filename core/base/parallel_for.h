// Loops over items on several threads. A thread that has finished an item takes the next one.
// parallel_for_in_order() also commits the results in the order of the items.
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <future>
#include <mutex>
#include <vector>

#include "core/base/clock.h"
#include "core/base/threads/kept_threads.h"

namespace voxdag {

// Calls body(worker, item) for the items 0 to count - 1, on up to `workers` threads including the
// caller. `worker` is the number of the thread; the caller is 0. After an exception no further item
// is started. Once all threads have stopped, the exception of the failed item with the lowest
// number is rethrown. So if the same items fail in every run, the exception is the same for any
// number of threads.
template <class Body>
void parallel_for(unsigned workers, size_t count, Body&& body) {
  std::atomic<size_t> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  size_t failed_item = count;
  const auto work = [&](unsigned worker) {
    size_t item = 0;
    try {
      while ((item = next.fetch_add(1, std::memory_order_relaxed)) < count) body(worker, item);
    } catch (...) {
      next.store(count, std::memory_order_relaxed);
      const std::lock_guard lock(mutex);
      if (item >= failed_item) return;
      failed_item = item;
      failure = std::current_exception();
    }
  };
  const auto work_and_end = [&](unsigned worker) {
    work(worker);
    ThreadTimes::add(worker);
  };
  std::vector<std::future<void>> others;
  try {
    others.reserve(std::min<size_t>(workers, count));  // push_back() must not throw
    for (unsigned worker = 1; worker < workers && worker < count; ++worker)
      others.push_back(KeptThreads::start([&, worker] { work_and_end(worker); }));
  } catch (const std::exception&) {
    // The system refused to start a thread. The threads started so far and the caller do all work.
  }
  work(0);
  for (std::future<void>& other : others) other.wait();
  if (failure) std::rethrow_exception(failure);
}

// Orders the commits of items that several threads process: each item gets a turn, in the order of
// the items' numbers. Thread-safe.
class Turns {
 public:
  // Waits for the turn of an item. The turn lasts until end(). Returns false if the item gets no
  // turn because an earlier item failed.
  bool wait_for(size_t item) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return item == turn_ || item > failed_; });
    return item == turn_;
  }
  // Ends the current turn. The next item then gets its turn.
  void end() {
    {
      const std::lock_guard lock(mutex_);
      ++turn_;
    }
    changed_.notify_all();
  }
  // True if an earlier item has failed, so that `item` gets no turn.
  bool is_lost(size_t item) {
    const std::lock_guard lock(mutex_);
    return item > failed_;
  }
  // Reports that an item failed. Later items then get no turn.
  void fail(size_t item) {
    const std::lock_guard lock(mutex_);
    failed_ = std::min(failed_, item);
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  size_t turn_ = 0;
  size_t failed_ = SIZE_MAX;
};

// Calls prepare(worker, item) for the items 0 to count - 1 on several threads, like parallel_for().
// Calls commit(worker, item) sequentially, in the order of the items. If prepare() or commit()
// throws for an item, the items before the first such item are still committed, and no others.
template <class Prepare, class Commit>
void parallel_for_in_order(unsigned workers, size_t count, Prepare&& prepare, Commit&& commit) {
  Turns turns;
  parallel_for(workers, count, [&](unsigned worker, size_t item) {
    if (turns.is_lost(item)) return;
    try {
      prepare(worker, item);
      if (!turns.wait_for(item)) return;
      commit(worker, item);
      turns.end();
    } catch (...) {
      turns.fail(item);
      throw;
    }
  });
}

}  // namespace voxdag
