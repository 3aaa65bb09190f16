// Asks long work to stop. Set from a signal handler or another thread; looked at by the work at
// least every few milliseconds.
#pragma once

#include <atomic>

#include "core/base/error.h"

namespace voxdag {

class CancelToken {
 public:
  // Async-signal-safe.
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  // Throws Error{kCancelled} once cancel() was called.
  void check() const {
    if (cancelled()) throw Error(ErrorCode::kCancelled, "cancelled");
  }

 private:
  std::atomic<bool> cancelled_{false};
  static_assert(std::atomic<bool>::is_always_lock_free, "cancel() runs in signal handlers");
};

}  // namespace voxdag
