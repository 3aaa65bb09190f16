#include "core/base/threads/kept_threads.h"

#include <utility>

namespace voxdag {
namespace {

thread_local KeptThreads* t_current = nullptr;

}  // namespace

KeptThreads::KeptThreads() : outer_(std::exchange(t_current, this)) {}

KeptThreads::~KeptThreads() {
  t_current = outer_;
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

std::future<void> KeptThreads::start(std::function<void()> work) {
  return t_current ? t_current->run(std::move(work))
                   : std::async(std::launch::async, std::move(work));
}

std::future<void> KeptThreads::run(std::function<void()> work) {
  Task task{std::move(work), {}};
  std::future<void> ended = task.ended.get_future();
  {
    const std::lock_guard lock(mutex_);
    if (idle_ <= tasks_.size()) threads_.emplace_back([this] { run_tasks(); });
    tasks_.push_back(std::move(task));
  }
  changed_.notify_one();
  return ended;
}

void KeptThreads::run_tasks() {
  std::unique_lock lock(mutex_);
  ++idle_;
  for (;;) {
    changed_.wait(lock, [&] { return is_ending_ || !tasks_.empty(); });
    if (tasks_.empty()) return;
    Task task = std::move(tasks_.front());
    tasks_.pop_front();
    --idle_;
    lock.unlock();
    task.work();
    lock.lock();
    // This thread is idle before the caller knows that the work has ended. So the caller's next
    // work does not need another thread.
    ++idle_;
    task.ended.set_value();
  }
}

}  // namespace voxdag
