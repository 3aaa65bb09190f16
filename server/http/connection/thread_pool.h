// Threads that come when there is work for them and stay for more. Work never waits for other work:
// how much there is at a time is bounded by whoever hands it in.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace voxdag::server {

class ThreadPool {
 public:
  ThreadPool() = default;
  // Waits for all work to end.
  ~ThreadPool();

  // `work` must not throw. Throws std::system_error if there is no thread for it.
  void run(std::function<void()> work);

 private:
  void work_on();

  std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  std::deque<std::function<void()>> waiting_;
  std::vector<std::thread> threads_;
  size_t idle_ = 0;
  bool ends_ = false;
};

}  // namespace voxdag::server
