// Decides whether looking up blocks in a memo is worthwhile. When most lookups miss, the memo is
// bypassed for a while. Not thread-safe.
#pragma once

#include <cstdint>

namespace voxdag::cpu {

class MemoGate {
 public:
  // True if the memo should be used for the next `count` blocks, which count as lookups; false
  // while the memo is bypassed.
  bool is_open(int count) {
    if (bypassed_ > 0) {
      bypassed_ -= count;
      return false;
    }
    lookups_ += count;
    if (lookups_ >= kWindow) {
      if (misses_ > lookups_ - lookups_ / 4) bypassed_ = kBypass;
      lookups_ = misses_ = 0;
    }
    return true;
  }
  void count_miss() { ++misses_; }

 private:
  // After each window of kWindow lookups in which more than three quarters missed, the memo is
  // bypassed for kBypass blocks.
  static constexpr int64_t kWindow = 1024;
  static constexpr int64_t kBypass = 16 * kWindow;

  int64_t lookups_ = 0, misses_ = 0;  // counts in the current window
  int64_t bypassed_ = 0;              // number of blocks until the memo is used again
};

}  // namespace voxdag::cpu
