// Limits how many operations of a kind run concurrently. Thread-safe.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>

namespace voxdag::server {

class ConcurrencyLimiter {
 public:
  explicit ConcurrencyLimiter(size_t max)
      : counter_(std::make_shared<std::atomic<size_t>>(0)), max_(max) {}

  // A permit, released when the last copy of the pointer is destroyed; null if none is free.
  std::shared_ptr<void> acquire() {
    if (counter_->fetch_add(1) >= max_) {
      counter_->fetch_sub(1);
      return nullptr;
    }
    return std::shared_ptr<void>(counter_.get(),
                                 [counter = counter_](void*) { counter->fetch_sub(1); });
  }
  size_t in_use() const { return *counter_; }

 private:
  std::shared_ptr<std::atomic<size_t>> counter_;
  size_t max_;
};

}  // namespace voxdag::server
