// Hands out the positions of a level to parts that are swept in parallel, in the order of the
// parts. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "merge/output/level_output.h"

namespace voxdag {

// Rows and positions of a level so far.
struct LevelExtent {
  uint64_t nodes = 0;
  uint64_t positions = 0;

  // Throws Error{kLimit} naming the level when positions would not fit 32 bits.
  void add(uint64_t more_nodes, uint64_t more_positions, uint32_t level, bool in_words) {
    nodes += more_nodes;
    positions += more_positions;
    if (positions > kPositionLimit)
      throw Error(ErrorCode::kLimit, "level " + std::to_string(level) + " of the merged DAG has " +
                                         "over 2^32 " + (in_words ? "words" : "nodes") +
                                         ", the limit of a level");
  }
};

class Sequencer {
 public:
  explicit Sequencer(uint64_t first_position) : position_(first_position) {}

  // Waits for the part's turn and returns its first position; none once the turnstile was closed.
  std::optional<uint64_t> enter(size_t part) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || part == turn_; });
    if (closed_) return std::nullopt;
    return position_;
  }
  // The part whose turn it is takes so many positions.
  void leave(uint64_t positions) {
    const std::lock_guard lock(mutex_);
    position_ += positions;
    ++turn_;
    changed_.notify_all();
  }
  // A part failed: nobody waits from now on.
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
