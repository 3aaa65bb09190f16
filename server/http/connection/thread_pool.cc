#include "server/http/connection/thread_pool.h"

namespace voxdag::server {

ThreadPool::~ThreadPool() {
  {
    std::lock_guard lock(mutex_);
    ends_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void ThreadPool::run(std::function<void()> work) {
  std::lock_guard lock(mutex_);
  if (idle_ <= waiting_.size()) threads_.emplace_back([this] { work_on(); });
  waiting_.push_back(std::move(work));
  wake_.notify_one();
}

void ThreadPool::work_on() {
  std::unique_lock lock(mutex_);
  for (;;) {
    ++idle_;
    wake_.wait(lock, [&] { return ends_ || !waiting_.empty(); });
    --idle_;
    if (waiting_.empty()) return;
    const std::function<void()> work = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    work();
    lock.lock();
  }
}

}  // namespace voxdag::server
