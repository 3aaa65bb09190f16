// A pool of threads that grows with the number of concurrent tasks, so that a task never waits for
// another task. The caller limits the number of concurrent tasks. Thread-safe.
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
  // Waits for all tasks to finish.
  ~ThreadPool();

  // Runs `task`, which must not throw, on a thread of the pool. Throws std::system_error if no
  // thread can be started for the task.
  void run(std::function<void()> task);

 private:
  void run_tasks();

  std::mutex mutex_;  // guards all members below
  std::condition_variable wake_;
  std::deque<std::function<void()>> tasks_;
  std::vector<std::thread> threads_;
  size_t idle_ = 0;
  bool stopping_ = false;
};

}  // namespace voxdag::server
