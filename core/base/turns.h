// The order in which several threads hand on what they have made of numbered items.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>

#include "core/base/parallel_for.h"

namespace voxdag {

// Gives each item a turn, in the order of their numbers. Thread-safe.
class Turns {
 public:
  // Waits for the turn of an item, which lasts until end(). False if the item has none because one
  // before it failed.
  bool wait_for(size_t item) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return item == turn_ || item > failed_; });
    return item == turn_;
  }
  void end() {
    const std::lock_guard lock(mutex_);
    ++turn_;
    changed_.notify_all();
  }
  // No item after this one gets its turn.
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

// Calls prepare(worker, item) for every item below `count`, on several threads as parallel_for()
// does, and then commit(worker, item), in the order of the items and one at a time. All items
// before the first that throws are committed, and no other.
template <class Prepare, class Commit>
void parallel_for_in_order(unsigned workers, size_t count, Prepare&& prepare, Commit&& commit) {
  Turns turns;
  parallel_for(workers, count, [&](unsigned worker, size_t item) {
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
