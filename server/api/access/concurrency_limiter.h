// A limit on how many of a thing there are at a time. Thread-safe.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>

namespace voxdag::server {

class ConcurrencyLimiter {
 public:
  explicit ConcurrencyLimiter(size_t most)
      : counter_(std::make_shared<std::atomic<size_t>>(0)), most_(most) {}

  // Taken until the pointer goes; null if all are.
  std::shared_ptr<void> take() {
    if (counter_->fetch_add(1) >= most_) {
      counter_->fetch_sub(1);
      return nullptr;
    }
    return std::shared_ptr<void>(counter_.get(),
                                 [counter = counter_](void*) { counter->fetch_sub(1); });
  }
  size_t taken() const { return *counter_; }

 private:
  std::shared_ptr<std::atomic<size_t>> counter_;
  size_t most_;
};

}  // namespace voxdag::server
