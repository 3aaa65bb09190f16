// A loop over items on several threads; each thread takes the next item when it is done with one.
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace voxdag {

// Calls body(worker, item) for every item below `count`, on up to `workers` threads, the caller's
// among them; `worker` is the number of the thread, from 0. After an exception no further item is
// started; the first exception is rethrown once all threads have stopped.
template <class Body>
void parallel_for(unsigned workers, size_t count, Body&& body) {
  std::atomic<size_t> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&](unsigned worker) {
    try {
      for (size_t item; (item = next.fetch_add(1, std::memory_order_relaxed)) < count;)
        body(worker, item);
    } catch (...) {
      next.store(count, std::memory_order_relaxed);
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  std::vector<std::thread> threads;
  try {
    for (unsigned worker = 1; worker < workers && worker < count; ++worker)
      threads.emplace_back(work, worker);
  } catch (const std::exception&) {
    // The system has no more threads: those that were started, and this one, do all the work.
  }
  work(0);
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace voxdag
