// A request to stop long work, made by a signal handler or another thread. The work checks it
// every few milliseconds. Thread-safe.
#pragma once

#include <atomic>

#include "core/base/error.h"

namespace voxdag {

class CancelToken {
 public:
  // Async-signal-safe.
  void cancel() { canceled_.store(true, std::memory_order_relaxed); }
  bool canceled() const { return canceled_.load(std::memory_order_relaxed); }
  // Throws Error{kCanceled} once cancel() was called.
  void check() const {
    if (canceled()) throw Error(ErrorCode::kCanceled, "canceled");
  }

 private:
  std::atomic<bool> canceled_{false};
  static_assert(std::atomic<bool>::is_always_lock_free, "cancel() runs in signal handlers");
};

}  // namespace voxdag
