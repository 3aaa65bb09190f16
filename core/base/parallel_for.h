// A loop over items on several threads; each thread takes the next item when it is done with one.
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "core/base/thread_times.h"

namespace voxdag {

// Calls body(worker, item) for every item below `count`, on up to `workers` threads, the caller's
// among them; `worker` is the number of the thread, from 0. After an exception no further item is
// started; once all threads have stopped, that of the first item is rethrown: if the same items
// fail each time, the same exception, whatever the number of threads.
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
  std::vector<std::thread> threads;
  try {
    for (unsigned worker = 1; worker < workers && worker < count; ++worker)
      threads.emplace_back(work_and_end, worker);
  } catch (const std::exception&) {
    // The system has no more threads: those that were started, and this one, do all the work.
  }
  work(0);
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace voxdag
