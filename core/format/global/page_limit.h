// Drops the resident pages of a mapped file when the process exceeds its memory limit, for readers
// that read the file from beginning to end. The system loads dropped pages again when they are
// used. Thread-safe.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "core/format/global/voxdag_reader.h"

namespace voxdag {

class PageLimit {
 public:
  static constexpr uint64_t kIntervalBytes = uint64_t{64} << 20;

  // `file` must outlive this object. `limit_bytes` is the limit of the process's resident memory.
  // The process can exceed it by `interval_bytes` of pages; by default, by an eighth of the limit.
  PageLimit(const voxdag_reader::File& file, uint64_t limit_bytes)
      : PageLimit(file, limit_bytes,
                  std::clamp(limit_bytes / 8, uint64_t{1}, uint64_t{kIntervalBytes})) {}
  PageLimit(const voxdag_reader::File& file, uint64_t limit_bytes, uint64_t interval_bytes)
      : file_(file), limit_bytes_(limit_bytes), interval_bytes_(interval_bytes) {}

  // Call it after reading `bytes` bytes of the file.
  void touch(uint64_t bytes) {
    const uint64_t before = touched_bytes_.fetch_add(bytes, std::memory_order_relaxed);
    if (before / interval_bytes_ != (before + bytes) / interval_bytes_) check();
  }
  // Drops the pages if the process exceeds its limit now. touch() calls it, so it is only needed
  // after other memory was filled.
  void check() const;
  // Returns the sum of the bytes that were passed to touch().
  uint64_t touched_bytes() const { return touched_bytes_; }

 private:
  const voxdag_reader::File& file_;
  const uint64_t limit_bytes_;
  const uint64_t interval_bytes_;
  std::atomic<uint64_t> touched_bytes_ = 0;
};

}  // namespace voxdag
