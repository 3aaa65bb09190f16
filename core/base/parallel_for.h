// A loop whose items are handed out to threads one by one, in order.
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
// among them; `worker` tells the threads apart. After an exception no further items are handed out,
// and once all threads have stopped the first exception is thrown again.
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
  } catch (const std::system_error&) {
    // The system gives no more threads: those that there are, this one at least, do all the work.
  }
  work(0);
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace voxdag
