// Limits the number of concurrent operations of one kind, in total and per client. The limit per
// client keeps one client from taking all permits. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace voxdag::server {

class ConcurrencyLimiter {
 public:
  ConcurrencyLimiter(size_t max, size_t max_per_client)
      : state_(std::make_shared<State>()), max_(max), max_per_client_(max_per_client) {}

  // Returns a permit, or null if no permit is free. The permit is released when the last copy of
  // the pointer is destroyed.
  std::shared_ptr<void> acquire(const std::string& client) {
    {
      std::lock_guard lock(state_->mutex);
      if (state_->in_use >= max_ || state_->by_client[client] >= max_per_client_) return nullptr;
      ++state_->by_client[client];
      ++state_->in_use;
    }
    return std::shared_ptr<void>(state_.get(),
                                 [state = state_, client](void*) { state->release(client); });
  }
  // Waits for a permit. Ignores the limit per client. Call it only for operations that take
  // milliseconds, because other callers wait for the permit.
  std::shared_ptr<void> wait() {
    std::unique_lock lock(state_->mutex);
    state_->released.wait(lock, [&] { return state_->in_use < max_; });
    ++state_->by_client[""];
    ++state_->in_use;
    return std::shared_ptr<void>(state_.get(), [state = state_](void*) { state->release(""); });
  }
  // Returns the limits, for messages.
  std::string limits() const {
    return "expected at most " + std::to_string(max_per_client_) + " per client and " +
           std::to_string(max_) + " in total";
  }
  size_t in_use() const {
    std::lock_guard lock(state_->mutex);
    return state_->in_use;
  }

 private:
  struct State {
    void release(const std::string& client) {
      std::lock_guard lock(mutex);
      --in_use;
      const auto found = by_client.find(client);
      if (--found->second == 0) by_client.erase(found);
      released.notify_one();
    }

    std::mutex mutex;  // guards in_use and by_client
    std::condition_variable released;
    size_t in_use = 0;
    std::map<std::string, size_t> by_client;
  };

  std::shared_ptr<State> state_;
  size_t max_, max_per_client_;
};

}  // namespace voxdag::server
