// Threads that run one piece of work after another. Starting and ending a thread takes a dozen
// system calls, and a build would otherwise do this for each of its stages.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <future>
#include <mutex>
#include <thread>
#include <vector>

namespace voxdag {

// While an object of this class exists, start() on the thread that constructed it uses the object's
// threads. Objects of one thread must be destroyed in the reverse order of their construction.
class KeptThreads {
 public:
  KeptThreads();
  // Ends the threads. All work must have ended.
  ~KeptThreads();
  KeptThreads(const KeptThreads&) = delete;
  KeptThreads& operator=(const KeptThreads&) = delete;

  // Runs `work`, which must not throw, on a thread that no other work uses at the same time: on an
  // idle thread of the calling thread's KeptThreads object, or on a new thread. The returned future
  // is ready when the work has ended; its destructor may or may not wait for that. Throws
  // std::system_error if the system refuses to start a thread.
  static std::future<void> start(std::function<void()> work);

 private:
  struct Task {
    std::function<void()> work;
    std::promise<void> ended;
  };

  std::future<void> run(std::function<void()> work);
  void run_tasks();

  KeptThreads* const outer_;  // the calling thread's object before this one
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Task> tasks_;  // tasks that no thread has taken yet
  size_t idle_ = 0;         // threads that wait for a task
  bool is_ending_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace voxdag
