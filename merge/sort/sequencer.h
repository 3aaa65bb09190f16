// Assigns the positions of a level to its buckets, which several threads sort at once, in the order
// of the buckets. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>

namespace voxdag {

class Sequencer {
 public:
  explicit Sequencer(uint64_t first_position) : position_(first_position) {}

  // Waits for the turn of a bucket and returns its first position; none once close() was called.
  std::optional<uint64_t> wait_for_turn(size_t bucket) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || bucket == turn_; });
    if (closed_) return std::nullopt;
    return position_;
  }
  // Ends the turn of the current bucket, which takes `positions`.
  void end_turn(uint64_t positions) {
    const std::lock_guard lock(mutex_);
    position_ += positions;
    ++turn_;
    changed_.notify_all();
  }
  // Wakes all that wait, after an error: no bucket gets its turn any more.
  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  uint64_t position_;
  size_t turn_ = 0;
  bool closed_ = false;
};

}  // namespace voxdag
