// A request to stop a running operation, for example a build.
#pragma once

#include <atomic>

#include "voxdag/error.h"

namespace voxdag {

// Thread-safe. The running operation calls check() regularly, so it ends soon after cancel().
class CancelToken {
 public:
  // Async-signal-safe.
  void cancel() { canceled_.store(true, std::memory_order_relaxed); }
  bool canceled() const { return canceled_.load(std::memory_order_relaxed); }
  // Throws Error{kCanceled} after cancel().
  void check() const {
    if (canceled()) throw Error(ErrorCode::kCanceled, "canceled");
  }

 private:
  std::atomic<bool> canceled_{false};
  static_assert(std::atomic<bool>::is_always_lock_free, "cancel() runs in signal handlers");
};

}  // namespace voxdag
