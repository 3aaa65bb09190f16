#include "server/http/connection/thread_pool.h"

namespace voxdag::server {

ThreadPool::~ThreadPool() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void ThreadPool::run(std::function<void()> task) {
  std::lock_guard lock(mutex_);
  if (idle_ <= tasks_.size()) threads_.emplace_back([this] { run_tasks(); });
  tasks_.push_back(std::move(task));
  wake_.notify_one();
}

void ThreadPool::run_tasks() {
  std::unique_lock lock(mutex_);
  for (;;) {
    ++idle_;
    wake_.wait(lock, [&] { return stopping_ || !tasks_.empty(); });
    --idle_;
    if (tasks_.empty()) return;
    const std::function<void()> task = std::move(tasks_.front());
    tasks_.pop_front();
    lock.unlock();
    task();
    lock.lock();
  }
}

}  // namespace voxdag::server
